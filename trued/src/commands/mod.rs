//! The subcommands, one file each.
//!
//! To add one: a file with `#[derive(clap::Args)] pub(crate) struct X` and `pub(crate) fn
//! run(&self, &mut Console) -> Outcome`, a variant below, an arm in [`run`]. Its position in the
//! help is already defined in `help.rs`.

mod bench;
mod bridge;
mod calibrate;
mod challenge;
mod check;
mod completions;
mod control;
mod convert;
mod correct;
mod demo;
mod diagnose;
mod doctor;
mod gears;
mod info;
mod learn;
mod live;
mod model;
mod plan;
mod reload;
mod replay;
mod run;
mod simulate;
mod spectrum;
mod stability;
mod status;
mod surface;
mod tap;
mod top;

use clap::Subcommand;

use crate::exit::Outcome;
use crate::output::Console;

/// What the program can do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Arm(control::Arm),
    Bench(Box<bench::Bench>),
    Bridge(bridge::Bridge),
    Bypass(control::Bypass),
    Calibrate(calibrate::Calibrate),
    Challenge(challenge::Challenge),
    Check(check::Check),
    Completions(completions::Completions),
    Convert(convert::Convert),
    Correct(correct::Correct),
    Demo(demo::Demo),
    Diagnose(diagnose::Diagnose),
    Doctor(doctor::Doctor),
    Gears(gears::Gears),
    Info(info::InfoCommand),
    Learn(learn::Learn),
    Live(live::LiveCommand),
    Mark(control::Mark),
    Record(control::Record),
    Mode(control::ModeCommand),
    Model(model::Model),
    Plan(Box<plan::Plan>),
    Reload(reload::Reload),
    Replay(replay::Replay),
    Run(run::Run),
    Simulate(simulate::Simulate),
    Spectrum(spectrum::Spectrum),
    Stability(stability::Stability),
    Status(status::StatusCommand),
    Surface(surface::Surface),
    Tap(tap::Tap),
    Top(top::Top),
}

/// Runs the selected command.
pub(crate) fn run(command: &Command, console: &mut Console) -> Outcome {
    match command {
        Command::Arm(arm) => arm.run(console),
        Command::Bench(bench) => bench.run(console),
        Command::Bridge(bridge) => bridge.run(console),
        Command::Bypass(bypass) => bypass.run(console),
        Command::Calibrate(calibrate) => calibrate.run(console),
        Command::Challenge(challenge) => challenge.run(console),
        Command::Check(check) => check.run(console),
        Command::Completions(completions) => completions.run(console),
        Command::Convert(convert) => convert.run(console),
        Command::Correct(correct) => correct.run(console),
        Command::Demo(demo) => demo.run(console),
        Command::Diagnose(diagnose) => diagnose.run(console),
        Command::Doctor(doctor) => doctor.run(console),
        Command::Gears(gears) => gears.run(console),
        Command::Info(info) => info.run(console),
        Command::Learn(learn) => learn.run(console),
        Command::Live(live) => live.run(console),
        Command::Mark(mark) => mark.run(console),
        Command::Record(record) => record.run(console),
        Command::Mode(mode) => mode.run(console),
        Command::Model(model) => model.run(console),
        Command::Plan(plan) => plan.run(console),
        Command::Reload(reload) => reload.run(console),
        Command::Replay(replay) => replay.run(console),
        Command::Run(run) => run.run(console),
        Command::Simulate(simulate) => simulate.run(console),
        Command::Spectrum(spectrum) => spectrum.run(console),
        Command::Stability(stability) => stability.run(console),
        Command::Status(status) => status.run(console),
        Command::Surface(surface) => surface.run(console),
        Command::Tap(tap) => tap.run(console),
        Command::Top(top) => top.run(),
    }
}

/// The schemas of everything that a command writes as JSON.
#[cfg(feature = "schema")]
pub(crate) fn result_schemas() -> Vec<crate::schemas::ResultSchema> {
    let several = [
        calibrate::result_schemas(),
        challenge::result_schemas(),
        diagnose::result_schemas(),
        model::result_schemas(),
        plan::result_schemas(),
    ];
    let one = [
        bench::result_schema(),
        check::result_schema(),
        control::result_schema(),
        convert::result_schema(),
        correct::result_schema(),
        demo::result_schema(),
        doctor::result_schema(),
        gears::result_schema(),
        info::result_schema(),
        learn::result_schema(),
        reload::result_schema(),
        replay::result_schema(),
        simulate::result_schema(),
        spectrum::result_schema(),
        stability::result_schema(),
        status::result_schema(),
        surface::result_schema(),
        tap::result_schema(),
    ];
    several.into_iter().flatten().chain(one).collect()
}
