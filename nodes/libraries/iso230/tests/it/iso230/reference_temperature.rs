//! Figures at 20 °C of machines that were measured warm.

use std::sync::LazyLock;

use iso230::budget::Expansion;
use iso230::positioning::PositioningRuns;
use iso230::positioning::budget::PositioningBudget;
use serde_json::Value;

use crate::iso230::{EXACT, RIGID, evaluated, near};

static REFERENCE: LazyLock<Value> =
    LazyLock::new(|| serde_json::from_str(include_str!("../../data/iso230_20_degc.json")).unwrap());

fn body(name: &str) -> Expansion {
    let number = |key: &str| REFERENCE[name][key].as_f64().unwrap();
    Expansion {
        temperature_deviation_k: number("temperature_degc") - 20.0,
        expansion_per_k: number("expansion_per_k"),
        ..RIGID
    }
}

#[test]
fn val_iso230_2_at_20_degc_numpy() {
    let list = |key: &str| serde_json::from_value(REFERENCE[key].clone()).unwrap();
    let rows = |key: &str| serde_json::from_value(REFERENCE[key].clone()).unwrap();
    let targets_mm: Vec<f64> = list("targets_mm");
    let warm = PositioningRuns {
        zero_mm: targets_mm[0],
        targets_mm,
        up_mm: rows("up_mm"),
        down_mm: rows("down_mm"),
        periods_mm: vec![],
    };
    let budget = PositioningBudget {
        machine: body("scale"),
        device_expansion: body("gauge"),
        ..EXACT
    };
    let at_20 = warm
        .clone()
        .corrected_to_20_degc(budget.differential_expansion());
    for (when, runs) in [("as_read", warm), ("at_20_degc", at_20)] {
        let found = evaluated(&runs);
        for (name, figure) in [
            ("e", found.systematic_error),
            ("a", found.accuracy),
            ("m", found.mean_systematic_error),
        ] {
            let expected = REFERENCE[when][name].as_f64().unwrap();
            near(&format!("{name} {when}"), figure.value_mm, expected, 1e-6);
        }
    }
}
