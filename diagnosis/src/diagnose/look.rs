//! Subsampling of long recordings: only the selected rows become poses.
//!
//! Promises: bit for bit the same diagnosis as with a campaign of all rows; gross errors are searched in evenly spread
//! rows. Never: a changed reading.

use super::thinning::{self, Rows, Stepwise};
use super::{Diagnosis, diagnose, of_chosen, ready};
use crate::campaign::Campaign;
use crate::from_recording::{Outline, Unusable, campaign};
use crate::gross::{self, Suspicion};
use physics::{Arm, Model};
use recording::series::Recording;

/// Recordings as they will be looked at.
#[derive(Debug)]
pub struct Thinned {
    /// The rows that are looked at.
    pub campaign: Campaign,
    /// Rows in which anything was measured, of all recordings.
    pub rows: usize,
    /// Whether any joint moves.
    pub moves: bool,
    /// What was left out, and rows spread evenly over all; none where all are looked at.
    chosen: Option<(String, Campaign)>,
}

impl Thinned {
    /// Chooses the rows of recordings of the robot `arm`.
    ///
    /// # Errors
    /// The first recording that cannot be used.
    pub fn at(arm: &Arm, recordings: &[Recording]) -> Result<Self, Unusable> {
        let outline = Outline::of(arm, recordings)?;
        let measured = || outline.measured.iter().filter(|measured| **measured);
        let (rows, moves) = (measured().count(), outline.moves);
        let Some(Stepwise { kept, read, says }) = thinning::choose(&Rows::from(&outline)) else {
            drop(outline);
            return Ok(Self { campaign: campaign(arm, recordings)?, rows, moves, chosen: None });
        };
        let of = (arm, recordings);
        let mut campaign = outline.campaign(of, &kept, &read)?;
        outline.set_moving(&mut campaign);
        ready::join(&mut campaign);
        let step = rows.div_ceil(gross::POSES_MAX).max(1);
        let mut count = 0;
        let few: Vec<bool> = outline
            .measured
            .iter()
            .map(|measured| {
                count += usize::from(*measured);
                *measured && (count - 1) % step == 0
            })
            .collect();
        let spread = outline.campaign(of, &few, &few)?;
        Ok(Self { campaign, rows, moves, chosen: Some((says, spread)) })
    }

    /// What is grossly wrong, as far as `model` is the robot that was measured; see [`gross::faults`].
    #[must_use]
    pub fn faults(&self, model: &Model) -> Vec<Suspicion> {
        let few = self.chosen.as_ref().map_or(&self.campaign, |(_, spread)| spread);
        gross::faults(few, model)
    }

    /// See [`diagnose`]; `held_out` goes with the poses of [`Thinned::campaign`].
    #[must_use]
    pub fn diagnose(
        self,
        model: &Model,
        sigma: &[Vec<f64>],
        held_out: Option<Vec<bool>>,
        seed: u64,
    ) -> Diagnosis {
        match self.chosen {
            None => diagnose(self.campaign, model, sigma, held_out, seed),
            Some((says, _)) => of_chosen(self.campaign, vec![says], model, sigma, held_out, seed),
        }
    }
}

#[cfg(test)]
mod tests;
