//! A program in KUKA's KRL.
//!
//! After KUKA's manuals for the system software: a program is a source `.src` and a data list
//! `.dat` of one name; `PTP` to an `E6AXIS` (A1 … A6, E1 … E6, degrees or mm) without `C_PTP` stops
//! there; `BAS(#INITMOV,0)` initialises motions, `BAS(#VEL_PTP,…)` and `BAS(#ACC_PTP,…)` set the
//! percentages of the axes' speeds and accelerations, `BAS(#TOOL,…)` the tool; `WAIT SEC` stops the
//! advance run, so that nothing after it is executed before the robot is at rest.

use super::{Axis, Program, figure};
use crate::faults::{Fault, Faults};

/// Settings of a KRL program besides poses and motions.
#[derive(Debug, Clone, PartialEq)]
pub struct Krl {
    /// Speed and acceleration of the axes, percent of their largest.
    pub percent: f64,
    /// Number of the tool whose load the controller uses, 0 to 16.
    pub tool: u8,
    /// Number of a digital output that is true during each rest, 1 to 8192.
    pub output: Option<u16>,
}

impl Default for Krl {
    /// 20 %, tool 0, no output.
    fn default() -> Self {
        Self { percent: 20.0, tool: 0, output: None }
    }
}

/// The two files of a KRL program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KrlFiles {
    /// `NAME.src`.
    pub src: String,
    /// `NAME.dat`.
    pub dat: String,
}

const HEAD: [&str; 2] = ["&ACCESS RVP", "&REL 1"];

impl Program {
    /// The program in KRL, for the files `NAME.src` and `NAME.dat`.
    ///
    /// # Errors
    /// A percentage, tool or output that no controller has.
    pub fn krl(&self, options: &Krl) -> Result<KrlFiles, Faults> {
        options.check(&self.name)?;
        let mut src = HEAD.map(str::to_owned).to_vec();
        let mut dat = src.clone();
        let percent = figure(options.percent);
        src.push(format!("DEF {}()", self.name));
        src.push(format!("; {}", self.heading()));
        src.push("BAS(#INITMOV,0)".to_owned());
        src.push(format!("BAS(#TOOL,{})", options.tool));
        src.push(format!("BAS(#VEL_PTP,{percent})"));
        src.push(format!("BAS(#ACC_PTP,{percent})"));
        src.push("PTP XREST".to_owned());
        dat.push(format!("DEFDAT {}", self.name));
        dat.push(self.declaration("XREST", &self.home));
        for (index, stop) in self.stops.iter().enumerate() {
            let number = index + 1;
            src.push(format!("; {}", self.description(index, stop)));
            if let Some(via) = &stop.via {
                src.push(format!("PTP XVIA{number}"));
                dat.push(self.declaration(&format!("XVIA{number}"), via));
            }
            src.push(format!("PTP XSTOP{number}"));
            dat.push(self.declaration(&format!("XSTOP{number}"), &stop.at));
            src.extend(self.rest(options));
        }
        src.extend(["PTP XREST".to_owned(), "END".to_owned(), String::new()]);
        dat.extend(["ENDDAT".to_owned(), String::new()]);
        Ok(KrlFiles { src: src.join("\n"), dat: dat.join("\n") })
    }

    fn rest(&self, options: &Krl) -> Vec<String> {
        let pause = format!("WAIT SEC {}", figure(self.pause_s));
        match options.output {
            None => vec![pause],
            Some(output) => vec![
                "WAIT SEC 0.0".to_owned(),
                format!("$OUT[{output}]=TRUE"),
                pause,
                format!("$OUT[{output}]=FALSE"),
            ],
        }
    }

    fn declaration(&self, name: &str, position: &[f64]) -> String {
        let mut pairs: Vec<(&Axis, &f64)> = self.axes.iter().zip(position).collect();
        pairs.sort_by_key(|(axis, _)| **axis);
        let pairs = pairs.into_iter().map(|(axis, value)| format!("{axis} {}", figure(*value)));
        let pairs: Vec<String> = pairs.collect();
        format!("DECL E6AXIS {name}={{{}}}", pairs.join(","))
    }
}

impl Krl {
    fn check(&self, program: &str) -> Result<(), Faults> {
        let mut faults = Faults::new(program);
        if !(self.percent >= 1.0 && self.percent <= 100.0) {
            faults.push(Fault::new("percent", format!("is {}", self.percent)).expected("1 to 100"));
        }
        if self.tool > 16 {
            faults.push(Fault::new("tool", format!("is {}", self.tool)).expected("0 to 16"));
        }
        if let Some(output) = self.output.filter(|output| !(1..=8192).contains(output)) {
            faults.push(Fault::new("output", format!("is {output}")).expected("1 to 8192"));
        }
        if faults.is_empty() { Ok(()) } else { faults.into_result(None) }
    }
}
