//! How long cases take to draw, and how strong they come out: `cargo run --release -p challenge --example drawn -- 40`.
#![expect(clippy::print_stdout, reason = "an example talks")]

use challenge::case::Tier;
use challenge::draw;

fn main() {
    let count = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(20);
    for index in 0..count {
        let start = std::time::Instant::now();
        let tier = Tier::mixed(index);
        let drawn = draw::case(1, index, tier);
        let case = &drawn.case;
        let hidden: Vec<_> = case.hidden.iter().map(|e| (e.kind, e.joint + 1)).collect();
        let (rows, values) = (case.scene.rows.len(), case.view.width(&case.scene));
        println!(
            "{index} {tier:?} {hidden:?} rows {rows}x{values} {:.2} s",
            start.elapsed().as_secs_f64()
        );
        for j in &drawn.judged {
            println!(
                "    z {:.1} rho {:.2} gain {:.1} rivals {:?} same {:?} unexplained {:.1}",
                j.z, j.rho, j.least_gain, j.rivals, j.same, j.unexplained_z
            );
        }
    }
}
