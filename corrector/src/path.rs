//! The commanded path and the memory of the effects.
//!
//! Memory advances once per accepted command, by the time of the commands.

use crate::direction::Directions;
use crate::judge::{Command, Follows};
use crate::settings::Settings;
use crate::world::World;
use physics::{Inputs, JOINTS_MAX, Memories, Model, Wrench};

/// State of the path so far.
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

    /// Inputs at the last accepted command.
    pub(crate) fn last(&self) -> Option<&Inputs> {
        self.last.as_ref()
    }

    pub(crate) fn memories(&self) -> &Memories {
        &self.memories
    }

    /// Sets the wrench that the environment exerts on the tool at the last command, base axes.
    pub(crate) fn load(&mut self, wrench_base: Wrench) {
        if let Some(inputs) = &mut self.last {
            inputs.wrench_base = wrench_base;
        }
    }

    /// For a new model: its effects have no memory yet and settle from the present directions.
    pub(crate) fn settle_anew(&mut self, model: &Model) {
        self.memories = Memories::default();
        if let Some(inputs) = &self.last {
            let unloaded = Inputs { wrench_base: Wrench::ZERO, ..*inputs };
            model.settle(&unloaded, &mut self.memories);
        }
    }

    /// Advances to an accepted command; returns the inputs of the model, without a wrench yet.
    pub(crate) fn follow(
        &mut self,
        model: &Model,
        settings: &Settings,
        command: &Command,
        world: &World,
        follows: Follows,
    ) {
        let Self { memories, directions, last } = self;
        let mut q = command.q;
        q[model.arm.count()..].fill(0.0);
        // In place: inputs are large, and the solve reads them from here.
        let (inputs, goes_on) = match (last, follows.after_ns()) {
            (Some(inputs), Some(dt_ns)) => {
                inputs.q_before = inputs.q;
                inputs.q = q;
                inputs.dt_s = dt_ns as f64 * 1e-9;
                inputs.time_s += inputs.dt_s;
                inputs.wrench_base = Wrench::ZERO;
                (inputs, true)
            }
            (last, _) => {
                *directions = Directions::at(&q);
                *memories = Memories::default();
                (last.insert(Inputs::at_rest(q)), false)
            }
        };
        inputs.ambient_celsius = world.ambient_celsius;
        inputs.joint_celsius = world.joint_celsius;
        inputs.spindle_rpm = world.spindle_rpm;
        directions.moved_to(&q, settings.reversal);
        inputs.direction = command.direction.unwrap_or(*directions.signs());
        let settled = command.settled && settings.lockstep;
        if goes_on && !settled {
            model.follow(inputs, memories);
        } else {
            model.settle(inputs, memories);
        }
    }
}
