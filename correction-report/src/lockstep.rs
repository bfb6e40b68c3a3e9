//! Processes a recording row by row without a clock: cell configuration, and the daemon's cycle without shared memory.
//!
//! `correct` and `replay` use the same ones, so that their results agree.

use std::path::Path;

use corrector::{Corrector, Residual, Settings};
use daemon::exchange::Exchange;
use daemon::sensor_inputs::SensorInputs;
use daemon::{setup, translate};
use recording::cell::CellConfig;
use recording::model::RobotModel;
use recording::series::Recording;
use shm_schema::{Corrected, CorrectionStatus};

use crate::error::Error;
use crate::setpoints::{TimedSetpoint, has_wrench};

/// Its name: short, since the transport limits the length of paths.
pub(crate) const CELL: &str = "r";

/// Its configuration, with the model in `model`.
pub(crate) fn cell_toml(model: &Path, recording: &Recording) -> String {
    let wrench = if has_wrench(recording) { "command" } else { "none" };
    // Quoted as TOML; a path that is not UTF-8 never gets here.
    let model = format!("{:?}", model.display().to_string());
    // The period is the interval at which the daemon looks for the next row: as short as possible.
    format!(
        "schema = \"trued.cell/1\"\ncell = \"{CELL}\"\nmodel = {model}\nmode = \"full\"\n\n\
         [cycle]\nperiod_ms = 0.1\n\n[wrench]\nsource = \"{wrench}\"\n"
    )
}

/// The daemon's cycle in this process, one row per call.
pub(crate) struct LockstepCycle<'m> {
    model: &'m RobotModel,
    corrector: Corrector,
    sensor_inputs: SensorInputs,
    exchange: Exchange,
    seq: u64,
    session: u64,
    frees_tool_axis: bool,
}

impl<'m> LockstepCycle<'m> {
    /// Before the first row.
    pub(crate) fn new(
        model: &'m RobotModel,
        settings: Settings,
        sensor_inputs: SensorInputs,
    ) -> Self {
        let exchange = Exchange::new(settings.mode, false);
        let frees_tool_axis = settings.task.free_tool_axis;
        let corrector = Corrector::new(settings);
        Self { model, corrector, sensor_inputs, exchange, seq: 0, session: 0, frees_tool_axis }
    }

    /// In the cell of [`cell_toml`].
    pub(crate) fn in_default_cell(
        model: &'m RobotModel,
        recording: &Recording,
    ) -> Result<Self, Error> {
        let text = cell_toml(Path::new("model.toml"), recording);
        let config = CellConfig::parse(CELL, &text).map_err(Error::system)?;
        let settings = setup::settings(&config, &model.physics.arm, true).map_err(Error::input)?;
        Ok(Self::new(model, settings, SensorInputs::new(setup::wrench_source(&config))))
    }

    /// Whether the tool may turn about its own axis.
    pub(crate) fn frees_tool_axis(&self) -> bool {
        self.frees_tool_axis
    }

    /// The daemon's answer to the next row.
    pub(crate) fn answer(&mut self, row: &TimedSetpoint) -> Result<Corrected, Error> {
        let Self { corrector, sensor_inputs, exchange, .. } = self;
        let model = &self.model.physics;
        self.seq += 1;
        self.session += u64::from(row.starts_segment);
        let command =
            row.setpoint.command(self.seq, self.session, row.t_ns).map_err(Error::input)?;
        let world = sensor_inputs.cycle_inputs(exchange, None, &command, row.t_ns);
        let claim = translate::command(&command, row.t_ns, true);
        let wanted = corrector.correct(model, &claim, &world, row.t_ns);
        let allowed = corrector.limit(model, &wanted);
        corrector.prepare(model);
        Ok(translate::corrected(&allowed, model.arm.count()))
    }

    /// The tool error left at the last row with an answer's correction, by the model. `None` if it
    /// is unknown: the row was rejected, or an effect is beyond its validity range.
    pub(crate) fn remaining_error(&self, answer: &Corrected) -> Option<Residual> {
        let is_rejected = answer.status() == Ok(CorrectionStatus::Rejected);
        let left = || self.corrector.residual_with(&self.model.physics, &answer.correction);
        if is_rejected { None } else { left() }
    }
}
