//! An ageing model: the running daemon receives measurements of the tool, and reports when its
//! model no longer holds, and since when.

use crate::TRUED;
use physics::{Inputs, JOINTS_MAX, Memories, Model};
use recording::model::RobotModel;
use shm_schema::monotonic_ns;
use std::time::Duration;
use tests::cell_loop::{JOINTS, MIDDLE};
use tests::place::TestDirectory;
use tests::process::Process;
use tests::rng::TestRng;
use trued_client::{Answer, Health, Measured, Monitor, Response, Status};

const LIMIT: Duration = Duration::from_secs(10);
const SIGMA_M: f64 = 5e-5;
const AMBIENT_C: f64 = 23.0;

/// A robot in front of a tracker, `drift` away from its model.
struct Bench {
    model: Model,
    chance: TestRng,
}

impl Bench {
    fn of(place: &TestDirectory) -> Self {
        let model = RobotModel::read(&place.file("model.toml")).unwrap().physics;
        Self { model, chance: TestRng::new(4) }
    }

    /// About normal, from the sum of twelve.
    fn noise(&mut self) -> f64 {
        SIGMA_M * ((0..12).map(|_| self.chance.uniform()).sum::<f64>() - 6.0)
    }

    fn measure(&mut self, monitor: &mut Monitor, drift_m: f64) -> Response {
        let mut q = [0.0; JOINTS_MAX];
        for (q, middle) in q.iter_mut().zip(MIDDLE) {
            *q = middle + self.chance.uniform() - 0.5;
        }
        let mut inputs = Inputs::at_rest(q);
        (inputs.direction, inputs.ambient_celsius) = ([1.0; JOINTS_MAX], AMBIENT_C);
        let mut memories = Memories::default();
        self.model.settle(&inputs, &mut memories);
        let tool = self.model.evaluate(&inputs, &memories).real.base_from_tool.origin;
        let point_m = [tool.x + drift_m, tool.y, tool.z].map(|x| x + self.noise());
        let measured = Measured {
            joints: &q[..JOINTS],
            direction: &[1; JOINTS],
            point_m,
            sigma_m: SIGMA_M,
            ambient_c: AMBIENT_C,
        };
        monitor.measured(&measured, LIMIT).unwrap()
    }
}

fn status(monitor: &mut Monitor) -> Status {
    // A status made after the report.
    std::thread::sleep(Duration::from_millis(150));
    monitor.status().unwrap()
}

#[test]
fn a_drift_is_reported_with_its_time_and_a_new_model_resets_the_test() {
    let place = TestDirectory::new("full", "");
    let daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    let mut monitor = Monitor::connect_to(&place.cell(), LIMIT).unwrap();
    let mut bench = Bench::of(&place);
    assert_eq!(status(&mut monitor).model_measurements, 0);
    for _ in 0..200 {
        let answer = bench.measure(&mut monitor, 0.0);
        assert_eq!(answer.answer(), Ok(Answer::Done), "{}", answer.message);
        assert!(answer.message.as_str().contains("the model is confirmed"), "{}", answer.message);
    }
    let quiet = status(&mut monitor);
    assert_eq!((quiet.model_broken_since_ns, quiet.model_measurements), (0, 200));
    let noise_m = SIGMA_M * 3_f64.sqrt();
    assert!((quiet.model_residual_m / noise_m - 1.0).abs() < 0.5, "{}", quiet.model_residual_m);

    let from_ns = monotonic_ns();
    let mut after = 0;
    while !bench.measure(&mut monitor, 2.0 * SIGMA_M).message.as_str().contains("has been outdated")
    {
        after += 1;
        assert!(after < 25, "two sigma are said soon");
        std::thread::sleep(Duration::from_millis(20));
    }
    let last = status(&mut monitor);
    let early_s = (from_ns as f64 - last.model_broken_since_ns as f64) * 1e-9;
    assert!(
        early_s.abs() < 0.2,
        "dated {early_s} s before the drift, it came {after} measurements ago"
    );
    assert_eq!(last.health(), Ok(Health::Idle), "no command comes, which is said first");
    assert!(
        last.message.as_str().contains("the model has been outdated since"),
        "{}",
        last.message
    );
    assert!(daemon.wait_for_output("the model is outdated", LIMIT), "{:?}", daemon.lines());

    assert_eq!(monitor.reload(None, LIMIT).unwrap().answer(), Ok(Answer::Done));
    let anew = status(&mut monitor);
    assert_eq!((anew.model_broken_since_ns, anew.model_measurements), (0, 0));
}

#[test]
fn a_measurement_that_makes_no_sense_is_refused_and_changes_nothing() {
    let place = TestDirectory::new("full", "");
    let daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    let mut monitor = Monitor::connect_to(&place.cell(), LIMIT).unwrap();
    let sound = Measured {
        joints: &MIDDLE,
        direction: &[],
        point_m: [0.8, 0.0, 0.9],
        sigma_m: SIGMA_M,
        ambient_c: f64::NAN,
    };
    let cases = [
        (Measured { joints: &MIDDLE[..5], ..sound }, "5 joints, the model has 6"),
        (Measured { joints: &[9.0; JOINTS], ..sound }, "within their limits"),
        (Measured { joints: &[f64::NAN; JOINTS], ..sound }, "finite"),
        (Measured { point_m: [f64::NAN; 3], ..sound }, "must be finite"),
        (Measured { sigma_m: 0.0, ..sound }, "above 0"),
    ];
    for (measured, part) in cases {
        let answer = monitor.measured(&measured, LIMIT).unwrap();
        assert_eq!(answer.answer(), Ok(Answer::Refused), "{}", answer.message);
        assert!(answer.message.as_str().contains(part), "{part}: {}", answer.message);
    }
    assert_eq!(status(&mut monitor).model_measurements, 0);
}
