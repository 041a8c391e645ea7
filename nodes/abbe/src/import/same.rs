//! Targets of several runs that are meant to be one.
//!
//! A laser's program notes where the axis stood, and that differs by a few micrometres from pass to pass. ISO 230-2 evaluates
//! each target over all passes. Deviations are from the target of their own row and stay as they are: over a few
//! micrometres the error of an axis does not change.

use std::collections::BTreeMap;

use metrology::number::number;

use super::map::Units;
use super::runs::SAME_TARGET_MM;
use super::table::Row;

/// Share of the least spacing of targets within which they are one where nothing is stated.
const SHARE: f64 = 0.01;
/// Greatest difference of targets that are one where nothing is stated, mm or deg.
const MAX_TARGET_SCATTER: f64 = 0.1;
/// Decimals of the roundest number, at most.
const MOST_DECIMALS: i32 = 6;

/// Least and greatest of values that are one target.
type Cluster = [f64; 2];

/// Gives rows whose targets are meant to be one the same target; what was done. `stated` is in the unit of deviations.
pub fn merge(runs: &mut [Vec<Row>], stated: Option<f64>, units: Units) -> Option<String> {
    let mut targets: Vec<f64> = runs.iter().flatten().map(|row| row.cells[1]).collect();
    targets.sort_by(f64::total_cmp);
    targets.dedup_by(|next, before| *next - *before <= SAME_TARGET_MM);
    let (clusters, how) = match stated {
        Some(stated) => {
            let most = stated * units.deviation_in_targets();
            let clusters = clusters(&targets, |low, _, next| next - low > most);
            (clusters, "same_target of the map".to_owned())
        }
        None => {
            let (clusters, least) = derived(&targets, runs)?;
            let unit = units.target;
            let how = format!(
                "they are at least {} {unit} apart from each other; same_target_{} in the map sets how far targets that are one may differ",
                number(least),
                units.of_cells[1].name()
            );
            (clusters, how)
        }
    };
    let widest = widest(&clusters);
    if widest <= SAME_TARGET_MM {
        return None;
    }
    for row in runs.iter_mut().flatten() {
        if let Some(cluster) = clusters.get(place(&clusters, row.cells[1])) {
            row.cells[1] = nominal(*cluster);
        }
    }
    Some(format!(
        "targets that differ by up to {} {} from pass to pass are one, {} instead of {}: {how}. Deviations stay as they were read",
        number(widest),
        units.target,
        clusters.len(),
        targets.len()
    ))
}

/// Groups ascending values; a new one begins where `is_next(first, last, next)`.
fn clusters(targets: &[f64], is_next: impl Fn(f64, f64, f64) -> bool) -> Vec<Cluster> {
    let mut all: Vec<Cluster> = vec![];
    for target in targets {
        match all.last_mut() {
            Some([low, high]) if !is_next(*low, *high, *target) => *high = *target,
            _ => all.push([*target; 2]),
        }
    }
    all
}

fn widest(clusters: &[Cluster]) -> f64 {
    let widths = clusters.iter().map(|[low, high]| high - low);
    widths.fold(0.0, f64::max)
}

/// The cluster that a value lies in.
fn place(clusters: &[Cluster], value: f64) -> usize {
    clusters
        .partition_point(|[low, _]| *low <= value + SAME_TARGET_MM)
        .saturating_sub(1)
}

/// The fewest clusters that are narrow beside what lies between them, with their least spacing.
fn derived(targets: &[f64], runs: &[Vec<Row>]) -> Option<(Vec<Cluster>, f64)> {
    let mut gaps: Vec<f64> = targets.windows(2).map(|two| two[1] - two[0]).collect();
    gaps.sort_by(f64::total_cmp);
    let steps = gaps.windows(2).rev();
    // A narrow cluster has no gap above its width, so gaps leap where narrow ones end.
    let leaps = steps.filter(|two| two[0] <= two[1] * SHARE);
    let mut candidates = leaps.map(|two| {
        let least = two[1];
        (
            clusters(targets, |_, last, next| next - last >= least),
            least,
        )
    });
    candidates.find(|(clusters, least)| {
        widest(clusters) <= (least * SHARE).min(MAX_TARGET_SCATTER) && are_apart(runs, clusters)
    })
}

/// Whether no run has two targets of one cluster: those it would have meant to be two.
fn are_apart(runs: &[Vec<Row>], clusters: &[Cluster]) -> bool {
    // Without a column of the direction a target comes twice, on the way there and on the way back.
    let most = |row: &Row| if row.cells.len() > 3 { 1 } else { 2 };
    runs.len() < 2
        || runs.iter().all(|rows| {
            let mut seen: BTreeMap<(usize, bool), u32> = BTreeMap::new();
            rows.iter().all(|row| {
                let is_down = row.cells.get(3).is_some_and(|way| *way < 0.0);
                let visit = (place(clusters, row.cells[1]), is_down);
                let n = seen.entry(visit).or_insert(0);
                *n += 1;
                *n <= most(row)
            })
        })
}

/// The roundest number from the least to the greatest value of a cluster.
fn nominal([low, high]: Cluster) -> f64 {
    let middle = f64::midpoint(low, high);
    if high - low <= SAME_TARGET_MM {
        return low;
    }
    let rounded = (0..=MOST_DECIMALS).map(|decimals| {
        let scale = 10_f64.powi(decimals);
        // No negative zero.
        (middle * scale).round() / scale + 0.0
    });
    let mut rounded = rounded.filter(|round| (low..=high).contains(round));
    rounded.next().unwrap_or(middle)
}

#[cfg(test)]
mod tests {
    use super::super::map::units;
    use super::*;
    use metrology::Axis;

    /// Runs of targets from both sides, each with its own differences.
    fn runs(targets: &[f64], differences: &[f64]) -> Vec<Vec<Row>> {
        let run = |(k, by): (usize, &f64)| {
            let row = |target: f64, way: f64| Row {
                line: 2,
                cells: vec![k as f64, target + by * way, 0.5, way],
            };
            let up = targets.iter().map(|target| row(*target, 1.0));
            let down = targets.iter().rev().map(|target| row(*target, -1.0));
            up.chain(down).collect()
        };
        differences.iter().enumerate().map(run).collect()
    }

    fn merged(runs: &mut [Vec<Row>], stated: Option<f64>) -> (Vec<f64>, Option<String>) {
        let said = merge(runs, stated, units(Axis::X));
        let mut targets: Vec<f64> = runs.iter().flatten().map(|row| row.cells[1]).collect();
        targets.sort_by(f64::total_cmp);
        targets.dedup();
        (targets, said)
    }

    #[test]
    fn targets_that_differ_by_micrometres_are_the_round_one_between_them() {
        let nominal = [0.0, 50.0, 101.0, 149.5, 200.0];
        let mut all = runs(&nominal, &[0.0011, -0.0019, 0.0005]);
        let (targets, said) = merged(&mut all, None);
        assert_eq!(targets, nominal);
        let said = said.expect("a remark");
        assert!(
            said.starts_with(
                "targets that differ by up to 0.0038 mm from pass to pass are one, 5 instead of 30"
            ),
            "{said}"
        );
        assert!(
            all.iter()
                .flatten()
                .all(|row| (row.cells[2] - 0.5).abs() < 1e-12)
        );
    }

    #[test]
    fn targets_that_are_meant_to_be_several_stay_so() {
        // Alike from run to run, evenly or not.
        for targets in [&[0.0, 0.01, 0.02, 50.0, 50.01][..], &[0.0, 3.0, 500.0]] {
            let mut all = runs(targets, &[0.0, 0.0, 0.0]);
            let (found, said) = merged(&mut all, None);
            assert_eq!((&found[..], said), (targets, None));
        }
        // A hundredth of 10 mm is 0.1 mm, and 0.3 mm are no scatter.
        let mut all = runs(&[0.0, 10.0, 20.0], &[0.15, -0.15]);
        assert_eq!(merged(&mut all, None).0.len(), 6);
        // Stated, they are one.
        assert_eq!(merged(&mut all, Some(400.0)).0, [0.0, 10.0, 20.0]);
        // Stated as none.
        let mut all = runs(&[0.0, 50.0], &[0.001, -0.001]);
        assert_eq!(merged(&mut all, Some(0.0)).0.len(), 4);
    }
}
