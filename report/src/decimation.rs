//! Decimation of long series for plots, without visible loss.
//!
//! At most [`POINTS_MAX`] entries remain; a signal keeps the least and the largest value of every
//! pixel column, so no peak is lost. `None` is a gap in a line; gaps narrower than a pixel column
//! are closed.

use std::collections::HashSet;

/// Limit on the points of a series in a drawing.
pub(crate) const POINTS_MAX: usize = 4500;

/// A point in pixels, or a gap.
pub(crate) type Spot = Option<(f64, f64)>;

/// Decimates a line: by pixel column if `x` is sorted, otherwise by distance.
pub(crate) fn line(spots: &[Spot]) -> Vec<Spot> {
    if spots.len() <= POINTS_MAX {
        return spots.to_vec();
    }
    let in_order = spots.iter().flatten().is_sorted_by(|a, b| a.0 <= b.0);
    let thinned = if in_order { by_column(spots) } else { by_distance(spots) };
    evenly(thinned)
}

/// Decimates dots: one for each cell of a grid that is as fine as the limit allows.
pub(crate) fn dots(spots: &[Spot]) -> Vec<Spot> {
    let drawn: Vec<Spot> = spots.iter().copied().filter(Option::is_some).collect();
    let mut kept = drawn;
    let mut cell_px = 0.5;
    while kept.len() > POINTS_MAX && cell_px < 64.0 {
        let mut taken = HashSet::new();
        kept.retain(|spot| {
            spot.is_some_and(|(x, y)| {
                taken.insert(((x / cell_px).floor() as i64, (y / cell_px).floor() as i64))
            })
        });
        cell_px *= 2.0;
    }
    evenly(kept)
}

/// First, least, largest and last value within one pixel column, by index.
struct Column {
    at_px: f64,
    first: usize,
    lowest: usize,
    highest: usize,
    last: usize,
    gap_after: bool,
}

fn by_column(spots: &[Spot]) -> Vec<Spot> {
    let height = |i: usize| spots[i].map_or(0.0, |spot| spot.1);
    let mut thinned = Vec::new();
    let mut open: Option<Column> = None;
    for (i, spot) in spots.iter().enumerate() {
        let Some((x, y)) = *spot else {
            if let Some(column) = &mut open {
                column.gap_after = true;
            }
            continue;
        };
        match &mut open {
            Some(column) if column.at_px == x.floor() => {
                column.gap_after = false;
                column.last = i;
                if y < height(column.lowest) {
                    column.lowest = i;
                }
                if y > height(column.highest) {
                    column.highest = i;
                }
            }
            _ => {
                close(open.take(), spots, &mut thinned);
                let at_px = x.floor();
                open = Some(Column {
                    at_px,
                    first: i,
                    lowest: i,
                    highest: i,
                    last: i,
                    gap_after: false,
                });
            }
        }
    }
    close(open, spots, &mut thinned);
    thinned
}

fn close(column: Option<Column>, spots: &[Spot], thinned: &mut Vec<Spot>) {
    let Some(column) = column else { return };
    let mut kept = [column.first, column.lowest, column.highest, column.last];
    kept.sort_unstable();
    let mut before = None;
    for i in kept {
        if before != Some(i) {
            thinned.push(spots[i]);
        }
        before = Some(i);
    }
    if column.gap_after {
        thinned.push(None);
    }
}

fn by_distance(spots: &[Spot]) -> Vec<Spot> {
    let mut apart_px = 0.5;
    loop {
        let kept = apart(spots, apart_px);
        if kept.len() <= POINTS_MAX || apart_px >= 4.0 {
            return kept;
        }
        apart_px *= 2.0;
    }
}

fn apart(spots: &[Spot], apart_px: f64) -> Vec<Spot> {
    let mut kept: Vec<Spot> = Vec::new();
    for spot in spots {
        let is_distant = match (spot, kept.last()) {
            (Some(point), Some(Some(last))) => {
                (point.0 - last.0).hypot(point.1 - last.1) >= apart_px
            }
            (None, Some(None)) => false,
            _ => true,
        };
        if is_distant {
            kept.push(*spot);
        }
    }
    if let (Some(last), Some(kept_last)) = (spots.last(), kept.last())
        && last != kept_last
    {
        kept.push(*last);
    }
    kept
}

/// The last resort for a path that fills its plot: every n-th entry.
fn evenly(spots: Vec<Spot>) -> Vec<Spot> {
    let stride = spots.len().div_ceil(POINTS_MAX).max(1);
    if stride == 1 { spots } else { spots.into_iter().step_by(stride).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_single_peak_in_a_million_samples_survives() {
        let mut spots: Vec<Spot> =
            (0..1_000_000).map(|i| Some((f64::from(i) * 8e-4, 100.0))).collect();
        spots[654_321] = Some((654_321.0 * 8e-4, 3.0));
        let thinned = line(&spots);
        assert!(thinned.len() <= POINTS_MAX);
        assert!(thinned.iter().flatten().any(|spot| spot.1 == 3.0));
        assert_eq!((thinned.first(), thinned.last()), (spots.first(), spots.last()));
    }

    #[test]
    fn a_gap_wider_than_a_pixel_stays_a_gap() {
        let spots: Vec<Spot> = (0..100_000)
            .map(|i| (!(40_000..60_000).contains(&i)).then_some((f64::from(i) * 8e-3, 1.0)))
            .collect();
        assert_eq!(line(&spots).iter().filter(|spot| spot.is_none()).count(), 1);
    }

    #[test]
    fn a_slow_path_keeps_its_shape() {
        let spots: Vec<Spot> = (0..200_000)
            .map(|i| f64::from(i) / 200_000.0 * std::f64::consts::TAU)
            .map(|angle| Some((400.0 + 100.0 * angle.cos(), 200.0 + 100.0 * angle.sin())))
            .collect();
        let thinned = line(&spots);
        assert!(thinned.len() < 2000, "{}", thinned.len());
        let longest = thinned.windows(2).filter_map(|w| Some((w[0]?, w[1]?)));
        assert!(longest.map(|(a, b)| (a.0 - b.0).hypot(a.1 - b.1)).fold(0.0, f64::max) < 1.1);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn the_bound_holds_for_noise_and_holes(seed in any::<u64>(), ordered in any::<bool>(), holes in 1u64..50) {
            let mut state = seed | 1;
            let mut next = || { state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1); state >> 33 };
            let spots: Vec<Spot> = (0..60_000u32).map(|i| {
                let x = if ordered { f64::from(i) / 75.0 } else { (next() % 800) as f64 };
                (next() % holes != 1).then_some((x, (next() % 300) as f64))
            }).collect();
            prop_assert!(line(&spots).len() <= POINTS_MAX);
            prop_assert!(dots(&spots).len() <= POINTS_MAX);
        }
    }
}
