//! The data of one torque diagnosis: rows, what the model states, and the library of candidates.
//!
//! The torque that the model states is subtracted first; parameters with a stated uncertainty are fitted along with it as prior. Selects nothing.

use physics::dynamics::INERTIAL;
use recording::series::{Heldout, Recording};
use std::cell::RefCell;

use super::ROWS_LEAST;
use super::known::{First, Stated};
use super::library::Library;
use super::load::Rubbing;
use super::motion::Motion;
use super::noise;
use super::rigid::Rigid;
use super::selection::Selection;
use super::sums::Sums;
use super::table::{Products, Solved, Table};
use crate::colour::Colour;

/// Stretches that all runs together are cut into; every fifth is the test set, every fifth of another count the validation set.
const STRETCHES: usize = 20;
const EVERY: usize = 5;
/// From a stretch of the test set to one of the validation set.
const BESIDE: usize = 2;
/// Runs from which on whole ones are held out.
const RUNS_MANY: usize = 10;
/// Periods of the band's edge beside what is held out that train nothing.
const GAP_PERIODS: f64 = 2.0;

/// Which rows are for what.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    pub(super) train: Vec<bool>,
    /// The validation set of the selection; the last fit uses it too.
    pub(super) look: Vec<bool>,
    pub(super) held: Vec<bool>,
    pub(super) says: String,
}

pub(super) struct Case {
    pub(super) motion: Motion,
    pub(super) table: Table,
    pub(super) library: Library,
    pub(super) rows: Rows,
    /// Columns that are in whatever is believed: masses of which nothing is known, numbers with a stated uncertainty.
    pub(super) open: Vec<usize>,
    /// Of these, the model's own numbers: column, the number's effect and place, the effect whose first it is.
    pub(super) known: Vec<(usize, (usize, usize), Option<First>)>,
    /// Columns of stated masses, in where these are doubted.
    pub(super) doubted: Vec<usize>,
    /// Joints that never move, with what they hold beyond what the model states, row by row.
    pub(super) still: Vec<(usize, Vec<f64>)>,
    /// Torque that the model states, per joint and row; and the part of it that its masses ask for.
    pub(super) stated: Vec<Vec<f64>>,
    pub(super) rigid: Vec<Vec<f64>>,
    /// That part at every sample, per joint and run, where the torque's band is narrower than what turns sharply is told in; else empty.
    pub(super) sharp: Vec<Vec<Vec<f64>>>,
    /// Friction that the model states to go with the load.
    pub(super) rubbing: Vec<Rubbing>,
    /// The first columns, those of the arm's own masses.
    pub(super) inertial: usize,
    /// The sums that were taken last.
    pub(super) sums: RefCell<Option<Sums>>,
}

impl Rows {
    fn of(motion: &Motion, recordings: &[Recording], seed: u64) -> Self {
        let count: usize = motion.runs.iter().map(|run| run.rows.len()).sum();
        let said = recordings.iter().any(|one| one.about.heldout != Heldout::Unsaid);
        let whole = motion.runs.len() >= RUNS_MANY;
        let (mut held, mut look) = (vec![false; count], vec![false; count]);
        let first = (seed % EVERY as u64) as usize;
        let (mut from, mut stretch, mut kept) = (0, 0, 0);
        for run in &motion.runs {
            let rows = from..from + run.rows.len();
            from = rows.end;
            let is_kept = match &recordings[run.recording].about.heldout {
                Heldout::All => true,
                Heldout::Segments(list) => list.contains(&run.segment),
                Heldout::Unsaid => false,
            };
            let share = rows.len() as f64 / count.max(1) as f64;
            let pieces =
                if whole { 1 } else { ((STRETCHES as f64 * share).round() as usize).max(1) };
            for piece in 0..pieces {
                let at = |k: usize| rows.start + k * rows.len() / pieces;
                let here = at(piece)..at(piece + 1);
                let turn = (stretch + EVERY - first) % EVERY;
                let drawn = if said { is_kept } else { turn == 0 };
                kept += usize::from(drawn);
                if drawn {
                    held[here].fill(true);
                } else if turn == BESIDE {
                    look[here].fill(true);
                }
                stretch += 1;
            }
        }
        let apart = apart(motion, &[&held, &look]);
        let train = (0..count).map(|row| !held[row] && !look[row] && !apart[row]).collect();
        let look = (0..count).map(|row| look[row] && !apart[row]).collect();
        let what = if whole { "runs" } else { "stretches" };
        let says = if said {
            "what the recordings keep for validation".to_owned()
        } else {
            format!("{kept} of {stretch} {what}, never seen by the selection or the fit")
        };
        Self { train, look, held, says }
    }

    /// All rows but those held out.
    pub(super) fn seen(&self) -> Vec<bool> {
        self.train.iter().zip(&self.look).map(|(a, b)| *a || *b).collect()
    }
}

/// Rows beside a border of what is set aside: the filter has mixed them.
fn apart(motion: &Motion, sets: &[&Vec<bool>]) -> Vec<bool> {
    let mut apart = Vec::new();
    for run in &motion.runs {
        let from = apart.len();
        let stride = run.rows.get(1).map_or(1, |second| second - run.rows[0]);
        let row_s = stride as f64 * run.step_s;
        let gap = (GAP_PERIODS / (motion.band_hz * row_s)).ceil() as usize;
        let side = |row: usize| sets.iter().map(|set| set[from + row]).collect::<Vec<bool>>();
        let count = run.rows.len();
        let mut border = vec![false; count];
        for row in 1..count {
            if side(row) != side(row - 1) {
                border[row.saturating_sub(gap)..(row + gap).min(count)].fill(true);
            }
        }
        apart.extend(border);
    }
    apart
}

impl Case {
    /// Reads motion out of the recordings and lists what may be missing.
    pub(super) fn new(
        stated: &Stated<'_>,
        recordings: &[Recording],
        band_hz: Option<f64>,
        seed: u64,
    ) -> Self {
        let arm = &stated.model.arm;
        let motion = Motion::of(arm, stated.delay_s, recordings, band_hz);
        let rows = Rows::of(&motion, recordings, seed);
        let rigid = Rigid::new(arm, &motion);
        let mut library = Library {
            columns: rigid.columns[..INERTIAL * arm.count()].to_vec(),
            prior: rigid.beliefs.iter().map(|sigma| 1.0 / (sigma * sigma)).collect(),
            families: Vec::new(),
            untested: Vec::new(),
        };
        let is_stated = |k: &usize| arm.joints()[k / INERTIAL].link.is_some();
        let all = 0..INERTIAL * arm.count();
        let doubted: Vec<usize> = all.clone().filter(is_stated).collect();
        let mut open: Vec<usize> = all.filter(|k| !is_stated(k)).collect();
        let known = stated.known(&motion);
        let mut places = Vec::with_capacity(known.open.len());
        for one in &known.open {
            places.push((library.columns.len(), one.of, one.first_of));
            open.push(library.columns.len());
            library.columns.push(one.column.clone());
            library.prior.push(1.0 / (one.sigma * one.sigma));
        }
        let sum = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a + b).collect();
        let torque: Vec<Vec<f64>> = rigid.stated.iter().zip(&known.torque).map(sum).collect();
        let mut table = table(&motion, &torque);
        let still = ask(stated, &motion, &mut table, &mut library);
        library.revise(&known.open);
        library.add_moments(arm, &motion);
        let of_mass = &rigid.columns[INERTIAL * arm.count()..];
        let several = recordings.len() > 1;
        let last_is_known = arm.joints().last().is_some_and(|joint| joint.link.is_some());
        if several || last_is_known {
            // A mass that hangs there in every recording is one with the last link's where nothing is known of it.
            let mut each: Vec<Option<usize>> = if last_is_known { vec![None] } else { Vec::new() };
            each.extend((0..recordings.len()).filter(|_| several).map(Some));
            each.iter().for_each(|one| library.payload(&motion, of_mass, arm.tool.tcp, *one));
        } else {
            let why = "nothing is known of the last link's mass: a payload is one with it";
            library.untested.push(("payload", None, why));
        }
        let inertial = INERTIAL * arm.count();
        let mut case = Self {
            motion,
            table,
            library,
            rows,
            open,
            known: places,
            doubted,
            still,
            stated: torque,
            rigid: rigid.stated,
            sharp: rigid.sharp,
            rubbing: Rubbing::stated(stated),
            inertial,
            sums: RefCell::default(),
        };
        case.of_torques(stated);
        case
    }

    /// Tells payloads about the places where this fit has them; whether any moved.
    pub(super) fn recentre(&mut self, selection: &Selection) -> bool {
        let of_inertia = self.inertial - 6..self.inertial;
        let mut moved = false;
        for name in &selection.names {
            let inertia = of_inertia.clone();
            moved |= self.library.recentre(&self.motion, *name, inertia, &selection.solved);
        }
        moved
    }

    /// Everything that may be missing at once, on all rows that are seen.
    pub(super) fn rich(&self) -> Solved {
        let products = self.products(&self.rows.train);
        products.solve(&(0..self.library.columns.len()).collect::<Vec<usize>>())
    }

    /// Whether numbers that are fitted along, held by what is believed of them, explain as much as a name: then belief alone speaks for it.
    pub(super) fn is_belief(&self, name: usize, always: &[usize]) -> bool {
        self.library.families[name].revises || self.is_of_masses(name, always)
    }

    /// Whether masses that are doubted may explain as much as a name.
    pub(super) fn is_of_masses(&self, name: usize, always: &[usize]) -> bool {
        let kind = self.library.families[name].kind;
        matches!(kind, "payload" | "inertia" | "gravity_torque")
            && self.doubted.iter().any(|k| always.contains(k))
    }

    /// The sums over the rows that count and that `used` takes.
    pub(super) fn products(&self, used: &[bool]) -> Products {
        let sums = Sums::taken(self.sums.take(), &self.table, &self.library.columns, used);
        let products = sums.products(self.library.prior.clone());
        self.sums.replace(Some(sums));
        products
    }

    /// Learns each joint's noise from what no effect explains.
    pub(super) fn estimate_noise(&mut self) {
        // The first look has no weights of joints, the second has.
        for _ in 0..2 {
            self.ignore_autocorrelation();
            let rich = self.rich();
            self.table.noise =
                noise::of(&self.table, &self.library.columns, &rich, &self.rows.train);
        }
    }

    /// From here on rows weigh by the size of their noise alone: numbers that shall hold for motions of any speed must not be drawn from the fast ones only, which is
    /// what noise with a long memory leaves of a model that is not quite right. Their uncertainty is told by blocks of time.
    pub(super) fn ignore_autocorrelation(&mut self) {
        self.table.noise.iter_mut().for_each(|(colour, _)| *colour = Colour::default());
    }

    /// What is left of a joint's torque.
    pub(super) fn residual(&self, solved: &Solved, joint: usize) -> Vec<f64> {
        noise::residual(&self.table, &self.library.columns, solved, joint)
    }
}

/// Lists what each joint that moves may lack; gives the joints that never do, with what they hold.
fn ask(
    stated: &Stated<'_>,
    motion: &Motion,
    table: &mut Table,
    library: &mut Library,
) -> Vec<(usize, Vec<f64>)> {
    let mut still = Vec::new();
    for joint in table.joints().collect::<Vec<usize>>() {
        let moves = &table.moves[joint];
        if moves.iter().filter(|moves| **moves).count() >= ROWS_LEAST {
            library.add_joint(stated, motion, joint);
            continue;
        }
        let never = !moves.contains(&true);
        let held = table.target[joint].take();
        still.extend(held.filter(|_| never).map(|held| (joint, held)));
        library.skip_joint(joint);
    }
    still
}

fn table(motion: &Motion, stated: &[Vec<f64>]) -> Table {
    let mut runs = Vec::new();
    let mut rows = 0;
    for run in &motion.runs {
        runs.push(rows..rows + run.rows.len());
        rows += run.rows.len();
    }
    let target = |joint: usize| {
        let mut all = Vec::with_capacity(rows);
        for run in &motion.runs {
            let torque = run.joints[joint].torque.as_ref()?;
            all.extend(run.rows.iter().map(|row| torque[*row]));
        }
        Some(all.iter().zip(&stated[joint]).map(|(torque, stated)| torque - stated).collect())
    };
    let moves: Vec<Vec<bool>> = (0..stated.len()).map(|joint| motion.moves(joint)).collect();
    Table {
        runs,
        target: (0..stated.len()).map(target).collect(),
        counts: moves.clone(),
        moves,
        noise: vec![(Colour::default(), 1.0); stated.len()],
    }
}
