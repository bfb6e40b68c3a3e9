//! A program in ABB's RAPID.
//!
//! After ABB's reference manual: `MoveAbsJ` moves to axis positions, with `\NoEOffs` unaffected by
//! offsets of external axes; a `jointtarget` has six robot axes in degrees and six external ones in
//! degrees or mm, 9E9 if unused;
//! `speeddata` is TCP mm/s, orientation deg/s, external mm/s and deg/s; `fine` is a stop; `WaitTime \InPos` counts from
//! standstill. A file contains one module.

use super::axes::AXES;
use super::{Axis, Program, check_name, figure};
use crate::faults::{Fault, Faults};

/// The longest name that RAPID accepts.
const NAME_MAX: usize = 32;

/// Settings of a RAPID program besides poses and motions.
#[derive(Debug, Clone, PartialEq)]
pub struct Rapid {
    /// Speed of the TCP and of linear external axes, mm/s.
    pub speed_mm_s: f64,
    /// Rotational speed of the tool and of rotary external axes, degrees/s.
    pub turn_deg_s: f64,
    /// The controller's tool data: only its load matters, since motions are in joint space.
    pub tool: String,
    /// A digital output that is 1 during each rest.
    pub output: Option<String>,
}

impl Default for Rapid {
    /// 100 mm/s, 20 degrees/s, `tool0`, no output.
    fn default() -> Self {
        Self { speed_mm_s: 100.0, turn_deg_s: 20.0, tool: "tool0".to_owned(), output: None }
    }
}

impl Program {
    /// The program as a RAPID module, for a file `NAME.mod`; its procedure has the name of the
    /// tour.
    ///
    /// # Errors
    /// An invalid speed, or a name that is not valid in RAPID.
    pub fn rapid(&self, options: &Rapid) -> Result<String, Faults> {
        options.check(&self.name)?;
        let mut lines = vec![format!("MODULE {}_mod", self.name)];
        lines.push(format!("    ! {}", self.heading()));
        let (speed, turn) = (figure(options.speed_mm_s), figure(options.turn_deg_s));
        lines.push(format!("    LOCAL CONST speeddata speed := [{speed},{turn},{speed},{turn}];"));
        lines.push(String::new());
        lines.push(format!("    PROC {}()", self.name));
        let mut say = |line: String| lines.push(format!("        {line}"));
        let go = |position: &[f64]| {
            format!(
                "MoveAbsJ {}\\NoEOffs, speed, fine, {};",
                self.jointtarget(position),
                options.tool
            )
        };
        let pause = figure(self.pause_s);
        say(go(&self.home));
        for (index, stop) in self.stops.iter().enumerate() {
            let description = self.description(index, stop);
            say(format!("! {description}"));
            if let Some(via) = &stop.via {
                say(go(via));
            }
            say(go(&stop.at));
            say(format!("TPWrite \"{description}\";"));
            match &options.output {
                None => say(format!("WaitTime \\InPos, {pause};")),
                Some(output) => {
                    say("WaitTime \\InPos, 0;".to_owned());
                    say(format!("SetDO {output}, 1;"));
                    say(format!("WaitTime {pause};"));
                    say(format!("SetDO {output}, 0;"));
                }
            }
        }
        say(go(&self.home));
        lines.extend(["    ENDPROC".to_owned(), "ENDMODULE".to_owned(), String::new()]);
        Ok(lines.join("\n"))
    }

    fn jointtarget(&self, position: &[f64]) -> String {
        let mut robot = ["0.0"; AXES].map(str::to_owned);
        let mut external = ["9E9"; AXES].map(str::to_owned);
        for (axis, value) in self.axes.iter().zip(position) {
            let slot = match axis {
                Axis::Robot(number) => robot.get_mut(number - 1),
                Axis::External(number) => external.get_mut(number - 1),
            };
            if let Some(slot) = slot {
                *slot = figure(*value);
            }
        }
        format!("[[{}],[{}]]", robot.join(","), external.join(","))
    }
}

impl Rapid {
    fn check(&self, program: &str) -> Result<(), Faults> {
        let mut faults = Faults::new(program);
        for (key, speed) in [("speed", self.speed_mm_s), ("turn", self.turn_deg_s)] {
            if !(speed > 0.0 && speed <= 10_000.0) {
                faults.push(
                    Fault::new(key, format!("is {speed}")).expected("above 0, at most 10000"),
                );
            }
        }
        check_name(&mut faults, "tool", &self.tool, NAME_MAX);
        if let Some(output) = &self.output {
            check_name(&mut faults, "output", output, NAME_MAX);
        }
        if faults.is_empty() { Ok(()) } else { faults.into_result(None) }
    }
}
