use recording::series::{Heldout, Need, read};
use std::path::Path;
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let model = recording::model::RobotModel::read(Path::new(&args[0])).unwrap();
    let mapping = (args[1] != "-").then(|| Path::new(&args[1]).to_owned());
    let mut all = Vec::new();
    for name in &args[2..] {
        let (name, h) = name.strip_prefix('+').map_or((name.as_str(), false), |n| (n, true));
        let mut r = read(Path::new(name), mapping.as_deref(), Need::Path).unwrap();
        if h {
            r.about.heldout = Heldout::All;
        }
        all.push(r);
    }
    let start = std::time::Instant::now();
    let d = diagnosis::torque::diagnose(&model.physics.arm, &[], &all, std::env::var("BAND").ok().map(|b| b.parse().unwrap()), 1).unwrap();
    println!("{:?} heldout {:?} noise {} signal {} carried by", d.verdict, d.heldout, d.noise, d.signal);
    for f in &d.findings {
        println!("{} {:?} rec {:?} conf {:.2} gain {:.0} held {:.3?}", f.kind, f.joint.map(|j| j + 1), f.recording, f.confidence, f.gain, f.heldout);
        for n in &f.numbers {
            println!("     {} {:.5?} ± {:.5?}", n.stem, n.values, n.sigma);
        }
        for r in &f.rivals {
            println!("     rival {} {:?} {:?} behind {:.1} conf {:.3}", r.kind, r.joint, r.stems, r.behind, r.confidence);
        }
    }
    for j in &d.by_joint {
        println!("{j:?}");
    }
    println!("{:?}", d.unexplained);
    for n in &d.notes {
        println!("{n}");
    }
    eprintln!("{:?}", start.elapsed());
}
