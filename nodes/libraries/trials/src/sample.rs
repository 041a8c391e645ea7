//! Verdicts for the tests of the judge.

use std::collections::BTreeMap;

use gap_diagnosis::report::Status;

use crate::arm::Arm;
use crate::effect::Class;
use crate::truth::{TrueEffect, Truth};
use crate::verdict::{Said, SaidCause, Verdict};

pub fn effect(class: Class, axis: &str, d: f64) -> TrueEffect {
    TrueEffect {
        class,
        axis: axis.to_owned(),
        size: 4.0,
        unit: "µm".to_owned(),
        parameter: class.parameter().map(str::to_owned),
        is_foreign: false,
        besides: vec![],
        d,
        common_d: None,
    }
}

pub fn cause(id: &str, axis: &str, status: Status, value: f64) -> SaidCause {
    SaidCause {
        effect: id.to_owned(),
        axis: axis.to_owned(),
        status,
        confidence: 0.9,
        d: 30.0,
        parameters: vec![("width_um".to_owned(), value, value - 0.2, value + 0.2)],
        rivals: vec![],
        constancy: (true, 1.0, String::new()),
    }
}

pub fn verdict(effects: Vec<TrueEffect>, causes: Vec<SaidCause>, is_unknown: bool) -> Verdict {
    Verdict {
        truth: Truth {
            arm: Arm::Catalogue,
            index: 0,
            seed: 1,
            effects,
            left_out: None,
            between_runs_um: 0.2,
            white_um: 0.1,
            has_outliers: false,
            has_motors: true,
            bare_um: Some(0.28),
            shop: None,
            designed: None,
            measure: crate::truth::MEASURE,
        },
        truth_sha256: String::new(),
        commit: String::new(),
        said: Some(Said {
            causes,
            is_unknown,
            unknown_ratio: 1.5,
            covariate: String::new(),
            is_reproduced: true,
            above_floor: true,
            gap_um: [3.0, 0.3],
            held_out_um: [Some(3.0), Some(0.3)],
            closed: Some([0.99, 0.98, 1.0]),
            runtime_s: 0.9,
            next: None,
        }),
        refused: None,
        diagnosis_s: 1.0,
        making_s: 1.0,
        ablated: None,
        baselines: BTreeMap::new(),
        likeness: vec![],
        later_closed: None,
        second: None,
        shop: None,
    }
}
