//! RSI: relative corrections, and pose corrections, at run time. The simulated controller
//! accumulates the values it receives.

use super::rsi::ethernet_of;
use super::{LIMIT, WIDE, corrected, count, daemon, ended, place};
use crate::TRUED;
use glam::DMat3;
use physics::Chain;
use recording::model::RobotModel;
use std::net::{SocketAddr, UdpSocket};
use std::time::Duration;
use tests::egm::{bridge, receive_datagram, socket};
use tests::place::TestDirectory;
use tests::process::Process;

const POSE: [f64; 6] = [10.0, 15.0, -10.0, 15.0, 45.0, 5.0];
const CYCLE: Duration = Duration::from_millis(4);
/// Slow, so that the correction ramps for hundreds of cycles.
const SLOW: &str = "[envelope]\nrate_mrad_s = 2.0\n";
const CYCLES: &str = "[cycle]\nperiod_ms = 4.0\nstale_ms = 200.0\n";
/// Resolution of an answer, deg or mm, with a margin.
const WRITTEN: f64 = 5e-6;

struct Controller {
    place: TestDirectory,
    _daemon: Process,
    bridge: Process,
    address: SocketAddr,
    socket: UdpSocket,
    ipoc: u64,
    late: u64,
}

impl Controller {
    /// A cell with a bridge that sends these values in this way.
    fn start(envelope: &str, names: &[String; 6], hold_on: u8, correction: &str) -> Self {
        let place = place(&format!("{envelope}{CYCLES}"));
        place.write("ethernet.xml", &ethernet_of(0x1000, names, hold_on));
        let text = format!(
            "schema = \"trued.bridge-rsi/1\"\ncell = \"cell.toml\"\nabsolute_accuracy = \"off\"\n\
             ethernet = \"ethernet.xml\"\n[robot]\naddress = \"127.0.0.1\"\nlisten = \"127.0.0.1:0\"\n\
             [setpoint]\nholds_correction = false\n[correction]\n{correction}\n[others]\nDiO = 0\n"
        );
        let daemon = daemon(&place);
        let (bridge, address) = bridge(TRUED, &[], "rsi", &place, &text);
        assert!(bridge.wait_for_output("connected to the daemon", LIMIT), "{:#?}", bridge.lines());
        Self { place, _daemon: daemon, bridge, address, socket: socket(), ipoc: 1000, late: 0 }
    }

    /// One telegram of a robot at rest, and the six values of its answer.
    fn cycle(&mut self) -> [f64; 6] {
        let axes: String =
            POSE.iter().enumerate().map(|(i, q)| format!(" A{}=\"{q}\"", i + 1)).collect();
        let telegram = format!(
            "<Rob Type=\"KUKA\"><ASPos{axes} /><Delay D=\"{}\" /><IPOC>{}</IPOC></Rob>",
            self.late, self.ipoc
        );
        self.socket.send_to(telegram.as_bytes(), self.address).unwrap();
        let (answer, _) = receive_datagram(&self.socket).expect("an answer");
        let answer = String::from_utf8(answer).unwrap();
        assert!(answer.contains(&format!("<IPOC>{}</IPOC>", self.ipoc)), "{answer}");
        self.ipoc += 4;
        std::thread::sleep(CYCLE);
        let group = answer.split("Korr ").nth(1).and_then(|rest| rest.split("/>").next()).unwrap();
        let numbers: Vec<f64> =
            group.split('"').skip(1).step_by(2).map(|number| number.parse().unwrap()).collect();
        numbers.try_into().unwrap()
    }

    /// The joints requested by the model, deg.
    fn wanted(&self) -> [f64; 6] {
        let wanted = corrected(&self.place, &vec![POSE.to_vec(); 2000]).pop().unwrap();
        wanted.try_into().unwrap()
    }
}

#[test]
fn relative_corrections_add_up_to_the_models_though_some_come_late() {
    let names = [1, 2, 3, 4, 5, 6].map(|i| format!("AKorr.A{i}"));
    let mut controller = Controller::start(SLOW, &names, 0, "kind = \"axes\"\nsums = \"relative\"");
    let (mut sum, mut largest, mut lost) = ([0.0; 6], 0.0_f64, 0.0_f64);
    let (mut cycle, mut at_rest) = (0, 0);
    // On a busy machine the daemon is late: the correction ramps out and in again, and arrives
    // later.
    while (cycle < 300 || at_rest < 100) && cycle < 5000 {
        let more = controller.cycle();
        at_rest = if more == [0.0; 6] { at_rest + 1 } else { 0 };
        largest = more.iter().fold(largest, |most, more| most.max(more.abs()));
        // Late answers: the controller does not use them, and counts them in its next telegram.
        if cycle % 25 == 24 && cycle < 200 {
            controller.late += 1;
            lost = more.iter().fold(lost, |most, more| most.max(more.abs()));
        } else {
            sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        }
        cycle += 1;
    }
    let wanted = controller.wanted();
    let error_deg =
        (0..6).fold(0.0_f64, |most, i| most.max((sum[i] - (wanted[i] - POSE[i])).abs()));
    println!(
        "relative: {error_deg:.1e} deg off, increments up to {largest:.4} deg, of those lost {lost:.4}"
    );
    assert!(lost > 20.0 * WRITTEN, "what was lost would be missed: {lost}");
    assert!(error_deg < WRITTEN, "{sum:?}, wanted {wanted:?} at {POSE:?}");
    assert!(largest < 0.06, "{largest} deg at once");
    let counted = ended(&mut controller.bridge);
    assert_eq!(count(&counted, "late answers counted by the controller"), 8, "{counted:#?}");
}

#[test]
fn a_pose_correction_puts_the_controllers_tool_where_the_corrected_joints_do() {
    for frame in ["base", "tool"] {
        let names = ["X", "Y", "Z", "A", "B", "C"].map(|name| format!("RKorr.{name}"));
        let kind = format!("kind = \"pose\"\nframe = \"{frame}\"\nsums = \"absolute\"");
        let mut controller = Controller::start(WIDE, &names, 1, &kind);
        let correction = (0..200).map(|_| controller.cycle()).last().unwrap();
        let arm = RobotModel::read(&controller.place.file("model.toml")).unwrap().physics.arm;
        let tool_pose = |degrees: &[f64; 6]| {
            let mut q = physics::Joints::default();
            q.iter_mut().zip(degrees).for_each(|(q, degrees)| *q = degrees.to_radians());
            Chain::nominal(&arm, &q).base_from_tool
        };
        let (before, after) = (tool_pose(&POSE), tool_pose(&controller.wanted()));
        let [x, y, z, a, b, c] = correction;
        let shift = glam::DVec3::new(x, y, z) * 1e-3;
        // As KUKA's frames: about z, then the new y, then the new x.
        let turn = DMat3::from_rotation_z(a.to_radians())
            * DMat3::from_rotation_y(b.to_radians())
            * DMat3::from_rotation_x(c.to_radians());
        let (origin, rotation) = match frame {
            "base" => (before.origin + shift, turn * before.rotation),
            _ => (before.origin + before.rotation * shift, before.rotation * turn),
        };
        let off_mm = (origin - after.origin).length() * 1e3;
        let turned = (rotation - after.rotation).to_cols_array();
        let off_rad = turned.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        println!("pose in {frame}: {correction:?}, {off_mm:.1e} mm and {off_rad:.1e} rad off");
        assert!(shift.length() > 1e-4, "there is something to correct: {correction:?}");
        assert!(off_mm < WRITTEN && off_rad < WRITTEN.to_radians(), "{off_mm} mm, {off_rad} rad");
    }
}
