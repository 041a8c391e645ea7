//! Nothing is wrong: nothing is named.

use crate::trials::plant::{Noise, diagnosed, names, session};

#[test]
fn a_machine_without_a_gap_gets_no_name() {
    let mut named = Vec::new();
    let mut flagged = 0;
    let seeds = 24;
    // 504 and 505 once got acceleration_lag, which was barely worth its price.
    for seed in (1000..1000 + seeds).chain([504, 505]) {
        let diagnosis = diagnosed(&session(seed, Noise::default(), &|_| [0.0; 2]));
        let found = names(&diagnosis);
        if !found.is_empty() {
            named.push((seed, found));
        }
        flagged += u32::from(diagnosis.report.unknown.flagged);
    }
    assert!(named.is_empty(), "{named:?}");
    assert!(flagged <= 2, "{flagged}");
}

#[test]
fn what_circles_cannot_show_is_listed_with_what_it_needs() {
    let report = diagnosed(&session(1100, Noise::default(), &|_| [0.0; 2])).report;
    let needs = |id: &str| {
        let own = report.not_excited.iter().find(|entry| entry.effect == id);
        own.map(|entry| entry.needs.as_str())
    };
    assert_eq!(needs("probe_latency"), Some("touches at two feeds or more"));
    for seen in ["backlash", "squareness", "servo_lag"] {
        assert_eq!(needs(seen), None, "{seen}");
    }
    let all = report.not_excited.iter();
    assert!(all.clone().all(|entry| !entry.needs.is_empty()));
}
