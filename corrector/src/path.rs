//! The commanded path and the memory of the effects.
//!
//! Memory advances once per accepted command, by the time of the commands.

use crate::command::{Command, Continuity};
use crate::cycle_inputs::CycleInputs;
use crate::direction::Directions;
use crate::settings::Settings;
use physics::{Inputs, JOINTS_MAX, Memories, Model, Wrench};

/// State of the path so far.
#[derive(Clone, Debug)]
pub(crate) struct PathState {
    memories: Memories,
    directions: Directions,
    last: Option<Inputs>,
}

impl PathState {
    pub(crate) fn new() -> Self {
        let directions = Directions::starting_at(&[0.0; JOINTS_MAX]);
        Self { memories: Memories::default(), directions, last: None }
    }

    /// Inputs at the last accepted command.
    pub(crate) fn last(&self) -> Option<&Inputs> {
        self.last.as_ref()
    }

    pub(crate) fn memories(&self) -> &Memories {
        &self.memories
    }

    /// Sets the wrench that the environment exerts on the tool at the last command, base axes.
    pub(crate) fn set_wrench(&mut self, wrench_base: Wrench) {
        if let Some(inputs) = &mut self.last {
            inputs.wrench_base = wrench_base;
        }
    }

    /// For a new model: its effects have no memory yet and settle from the present directions.
    pub(crate) fn resettle(&mut self, model: &Model) {
        self.memories = Memories::default();
        if let Some(inputs) = &self.last {
            let unloaded = Inputs { wrench_base: Wrench::ZERO, ..*inputs };
            model.settle(&unloaded, &mut self.memories);
        }
    }

    /// Advances to an accepted command; stores the inputs of the model, without a wrench yet.
    pub(crate) fn advance(
        &mut self,
        model: &Model,
        settings: &Settings,
        command: &Command,
        cycle_inputs: &CycleInputs,
        continuity: Continuity,
    ) {
        let Self { memories, directions, last } = self;
        let mut q = command.q;
        q[model.arm.count()..].fill(0.0);
        // In place: inputs are large, and the solve reads them from here.
        let (inputs, continues) = match (last, continuity.interval_ns()) {
            (Some(inputs), Some(dt_ns)) => {
                inputs.q_before = inputs.q;
                inputs.q = q;
                inputs.dt_s = dt_ns as f64 * 1e-9;
                inputs.time_s += inputs.dt_s;
                inputs.wrench_base = Wrench::ZERO;
                (inputs, true)
            }
            (last, _) => {
                *directions = Directions::starting_at(&q);
                *memories = Memories::default();
                (last.insert(Inputs::at_rest(q)), false)
            }
        };
        inputs.ambient_celsius = cycle_inputs.ambient_celsius;
        inputs.joint_celsius = cycle_inputs.joint_celsius;
        inputs.spindle_rpm = cycle_inputs.spindle_rpm;
        directions.update(&q, settings.reversal);
        inputs.direction = command.direction.unwrap_or(*directions.signs());
        let settled = command.settled && settings.lockstep;
        if continues && !settled {
            model.follow(inputs, memories);
        } else {
            model.settle(inputs, memories);
        }
    }
}
