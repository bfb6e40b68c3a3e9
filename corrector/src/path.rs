//! What was commanded and what the effects remember of it.
//!
//! Promises: memory advances once per command that passed; time is the commands' own. Never: a solution.

use crate::direction::Directions;
use crate::judge::{Command, Follows};
use crate::settings::Settings;
use crate::world::World;
use physics::{Inputs, JOINTS_MAX, Memories, Model};

/// The path so far.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    memories: Memories,
    directions: Directions,
    last: Option<Inputs>,
}

impl Path {
    pub(crate) fn new() -> Self {
        let directions = Directions::at(&[0.0; JOINTS_MAX]);
        Self { memories: Memories::default(), directions, last: None }
    }

    /// The last command that passed, with what was known then.
    pub(crate) fn last(&self) -> Option<&Inputs> {
        self.last.as_ref()
    }

    pub(crate) fn memories(&self) -> &Memories {
        &self.memories
    }

    /// Another model: its effects remember nothing yet and settle from the present directions.
    pub(crate) fn settle_anew(&mut self, model: &Model) {
        self.memories = Memories::default();
        if let Some(inputs) = &self.last {
            model.settle(inputs, &mut self.memories);
        }
    }

    /// Follows a command that passed; what goes into the model, without a wrench.
    pub(crate) fn follow(
        &mut self,
        model: &Model,
        settings: &Settings,
        command: &Command,
        world: &World,
        follows: Follows,
    ) -> Inputs {
        let mut inputs = Inputs::at_rest(command.q);
        inputs.q[model.arm.count()..].fill(0.0);
        inputs.q_before = inputs.q;
        inputs.ambient_celsius = world.ambient_celsius;
        inputs.joint_celsius = world.joint_celsius;
        inputs.spindle_rpm = world.spindle_rpm;
        let after = self.last.zip(follows.after_ns());
        if let Some((before, dt_ns)) = after {
            inputs.q_before = before.q;
            inputs.dt_s = dt_ns as f64 * 1e-9;
            inputs.time_s = before.time_s + inputs.dt_s;
        } else {
            self.directions = Directions::at(&inputs.q);
            self.memories = Memories::default();
        }
        self.directions.moved_to(&inputs.q, settings.reversal);
        inputs.direction = command.direction.unwrap_or(*self.directions.signs());
        let settled = command.settled && settings.lockstep;
        if after.is_some() && !settled {
            model.follow(&inputs, &mut self.memories);
        } else {
            model.settle(&inputs, &mut self.memories);
        }
        self.last = Some(inputs);
        inputs
    }
}
