//! Nothing is wrong: nothing is named.

use crate::plant::{Noise, diagnosed, names, session};

#[test]
fn a_machine_without_a_gap_gets_no_name() {
    let mut named = Vec::new();
    let mut flagged = 0;
    let seeds = 24;
    for seed in 0..seeds {
        let diagnosis = diagnosed(&session(1000 + seed, Noise::default(), &|_| [0.0; 2]));
        let found = names(&diagnosis);
        if !found.is_empty() {
            named.push((seed, found));
        }
        flagged += u32::from(diagnosis.report.unknown.flagged);
    }
    assert!(named.is_empty(), "{named:?}");
    assert!(flagged <= 2, "{flagged}");
}
