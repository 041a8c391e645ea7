//! A small fixed set that must not fall below what it has reached: machines whose drawing never changes, diagnosed
//! by whatever the diagnosis has become, held to the intervals of the table that was published of them
//! (`published.json`; README.md says how it is made).

use std::path::Path;

use serde_json::Value;

use crate::series::{folder, run};

/// Which trials, as in the README.
const SET: [&str; 7] = [
    "--arm",
    "i,iii,iv,alone",
    "--n",
    "4",
    "--seed",
    "11",
    "--in-process",
];

/// Rates that should be high.
const HIGH: [&str; 9] = [
    "diagnosed",
    "floor reproduced",
    "nothing named",
    "nothing hidden: nothing named",
    "1 effect, D > 10: exact",
    "2-3 effects, each D > 7: exact",
    "all D > 20: exact",
    "each effect, D > 20: named, class and axis",
    "each effect, D > 20: in a reported set",
];

/// Rates that should be low.
const LOW: [&str; 2] = [
    "a cause named that is none",
    "wrong and not flagged unknown",
];

/// A rate of an arm: share, and ends of its interval; none of nothing.
fn rate(tally: &Value, what: &str) -> Option<(f64, [f64; 2])> {
    let rates = tally["rates"].as_array().unwrap();
    let found = rates.iter().find(|rate| rate["what"] == what)?;
    let count = |key: &str| found["count"][key].as_f64().unwrap();
    let end = |place: usize| found["interval"][place].as_f64().unwrap();
    (count("n") > 0.0).then(|| (count("k") / count("n"), [end(0), end(1)]))
}

/// What dropped out of its published interval.
fn dropped(published: &Value, now: &Value) -> Vec<String> {
    let mut all = vec![];
    for before in published["arms"].as_array().unwrap() {
        let arms = now["arms"].as_array().unwrap();
        let arm = &before["arm"];
        let Some(after) = arms.iter().find(|tally| tally["arm"] == *arm) else {
            all.push(format!("arm {arm} is gone"));
            continue;
        };
        for (what, is_high) in HIGH
            .map(|what| (what, true))
            .into_iter()
            .chain(LOW.map(|what| (what, false)))
        {
            let Some((_, [low, high])) = rate(before, what) else {
                continue;
            };
            let holds = rate(after, what)
                .is_some_and(|(share, _)| if is_high { share >= low } else { share <= high });
            if !holds {
                all.push(format!("arm {arm}, {what}: {:?}", rate(after, what)));
            }
        }
    }
    all
}

#[test]
fn no_rate_of_the_fixed_set_drops_out_of_its_published_interval() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("trials/published.json");
    let published: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let folder = folder();
    let (now, said) = run(folder.path(), &SET);
    assert_eq!(now["trials"], published["trials"]);
    let dropped = dropped(&published, &now);
    assert!(dropped.is_empty(), "{dropped:#?}\n{said}");
}

#[test]
fn a_rate_below_its_interval_and_an_arm_that_is_gone_are_noticed() {
    let table = |k: u32, wrong: u32, arm: &str| {
        let line = |what: &str, k: u32| serde_json::json!({"what": what, "count": {"k": k, "n": 10}, "interval": [0.6, 0.98]});
        serde_json::json!({"arms": [{
            "arm": arm,
            "rates": [line("nothing named", k), line("a cause named that is none", wrong)],
        }]})
    };
    let published = table(9, 9, "null");
    assert!(dropped(&published, &table(7, 9, "null")).is_empty());
    assert_eq!(dropped(&published, &table(5, 9, "null")).len(), 1);
    assert_eq!(dropped(&published, &table(9, 10, "null")).len(), 1);
    assert_eq!(dropped(&published, &table(9, 9, "foreign")).len(), 1);
}
