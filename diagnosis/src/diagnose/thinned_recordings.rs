//! Subsampling of long recordings before the conversion to poses, to save memory: only the selected rows become poses.
//!
//! Gross errors are searched in rows that are evenly spread over the recording. Invariant: the result equals that of subsampling after the
//! conversion, bit for bit.

use super::thinning::{self, RowProperties, RowSelection};
use super::{Diagnosis, diagnose, diagnose_selected_rows, preparation};
use crate::campaign::Campaign;
use crate::campaign_import::{CampaignError, RecordingSummary, campaign};
use crate::gross_errors::{self, SuspectedError};
use crate::progress::Listener;
use physics::{Arm, Model};
use recording::series::Recording;

/// Recordings after subsampling.
#[derive(Debug)]
pub struct ThinnedRecordings {
    /// Poses of the selected rows.
    pub campaign: Campaign,
    /// Number of rows with measurements, of all recordings.
    pub rows: usize,
    /// Whether any joint moves.
    pub moves: bool,
    /// Message on the subsampling, and a campaign of evenly spread rows; `None` if all rows are used.
    chosen: Option<(String, Campaign)>,
}

impl ThinnedRecordings {
    /// Selects rows of recordings of the robot `arm`.
    ///
    /// # Errors
    /// The first recording that cannot be used.
    pub fn select(arm: &Arm, recordings: &[Recording]) -> Result<Self, CampaignError> {
        let outline = RecordingSummary::of(arm, recordings)?;
        let measured = || outline.measured.iter().filter(|measured| **measured);
        let (rows, moves) = (measured().count(), outline.moves);
        let Some(RowSelection { kept, measured_kept, note }) =
            thinning::select_rows(&RowProperties::from(&outline))
        else {
            drop(outline);
            return Ok(Self { campaign: campaign(arm, recordings)?, rows, moves, chosen: None });
        };
        let inputs = (arm, recordings);
        let mut campaign = outline.campaign(inputs, &kept, &measured_kept)?;
        outline.set_moving(&mut campaign);
        preparation::relink_poses(&mut campaign);
        let step = rows.div_ceil(gross_errors::POSES_MAX).max(1);
        let mut count = 0;
        let few: Vec<bool> = outline
            .measured
            .iter()
            .map(|measured| {
                count += usize::from(*measured);
                *measured && (count - 1) % step == 0
            })
            .collect();
        let spread = outline.campaign(inputs, &few, &few)?;
        Ok(Self { campaign, rows, moves, chosen: Some((note, spread)) })
    }

    /// Gross errors of the recordings if `model` describes the measured robot; see [`gross_errors::detect_gross_errors`].
    #[must_use]
    pub fn faults(&self, model: &Model) -> Vec<SuspectedError> {
        let few = self.chosen.as_ref().map_or(&self.campaign, |(_, spread)| spread);
        gross_errors::detect_gross_errors(few, model)
    }

    /// See [`diagnose`]; `held_out` has one entry per pose of [`ThinnedRecordings::campaign`].
    #[must_use]
    pub fn diagnose(
        self,
        model: &Model,
        sigma: &[Vec<f64>],
        held_out: Option<Vec<bool>>,
        seed: u64,
        listener: Listener<'_>,
    ) -> Diagnosis {
        let Self { campaign, chosen, .. } = self;
        match chosen {
            None => diagnose(campaign, model, sigma, held_out, seed, listener),
            Some((note, _)) => {
                let notes = vec![note];
                diagnose_selected_rows(campaign, notes, model, sigma, held_out, seed, listener)
            }
        }
    }
}

#[cfg(test)]
mod tests;
