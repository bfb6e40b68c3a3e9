fn main() {
    let mut all = Vec::new();
    for seed in 1..9 {
        let mut s = tests::simulation::run(seed, 200000);
        println!(
            "{seed} {} {:?}",
            s.cycles,
            s.broken.map(|b| b.chars().take(150).collect::<String>())
        );
        all.append(&mut s.back_after_ms);
    }
    all.sort();
    let q = |p: f64| all[((all.len() - 1) as f64 * p) as usize];
    println!(
        "{} storms: 0.1 {} 0.5 {} 0.9 {} 0.99 {} max {}",
        all.len(),
        q(0.1),
        q(0.5),
        q(0.9),
        q(0.99),
        q(1.0)
    );
}
