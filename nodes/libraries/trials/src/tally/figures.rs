//! What of an arm is not a share: sizes, shares of the gap closed, times.

use serde::{Deserialize, Serialize};

use super::MIN_D_OF_FOREIGN;
use crate::calibration::calibration;
use crate::proportion::{Proportion, median, quantile};
use crate::target::LONGEST_DIAGNOSIS_S;
use crate::verdict::Verdict;

/// One number with what it is of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// What it is.
    pub what: String,
    /// It; none where there is nothing to take it of.
    pub value: Option<f64>,
    /// Of how many.
    pub n: usize,
    /// Whether it is how many of them.
    #[serde(default)]
    pub is_count: bool,
}

impl Figure {
    /// A figure.
    #[must_use]
    pub fn new(what: &str, value: Option<f64>, n: usize) -> Self {
        Self {
            what: what.to_owned(),
            value,
            n,
            is_count: false,
        }
    }

    fn middle(what: &str, values: Vec<f64>) -> Self {
        let n = values.len();
        Self::new(what, median(values), n)
    }

    fn count(what: &str, count: Proportion) -> Self {
        Self {
            is_count: true,
            ..Self::new(what, Some(count.k as f64), count.n)
        }
    }
}

/// The figures of an arm.
pub fn of(own: &[&Verdict]) -> Vec<Figure> {
    let mut figures = Vec::new();
    let mut add = |what: &str, values: Vec<f64>| figures.push(Figure::middle(what, values));
    let pairs = || {
        own.iter()
            .flat_map(|v| v.truth.effects.iter().map(move |e| (v, e)))
    };
    let sized = || pairs().filter_map(|(v, e)| Some((e, v.sized(e)?)));
    let scaled = sized()
        .filter(|(e, _)| e.d > MIN_D_OF_FOREIGN)
        .map(|(e, (error, _))| error.abs() * e.d);
    add(
        "median relative error of a parameter times D, D > 20",
        scaled.collect(),
    );
    let covered: Vec<bool> = sized().map(|(_, (_, covered))| covered).collect();
    let said = || {
        own.iter()
            .filter_map(|v| v.said.as_ref().map(|said| (*v, said)))
    };
    let hidden = || said().filter(|(v, _)| v.least_d().is_some_and(|d| d > MIN_D_OF_FOREIGN));
    add(
        "median gap closed on held-out runs, D > 20",
        hidden()
            .filter_map(|(_, said)| Some(said.closed?[0]))
            .collect(),
    );
    add(
        "median rms after over before on held-out runs, D > 20",
        hidden()
            .filter_map(|(_, said)| Some(said.held_out_um[1]? / said.held_out_um[0]?))
            .collect(),
    );
    add(
        "median gap closed over that of an oracle, D > 20",
        hidden().filter_map(|(v, _)| v.closed_of_oracle()).collect(),
    );
    figures.extend(times(own));
    let count = Proportion::of(covered.into_iter());
    figures.push(Figure::new(
        "share of 95 % intervals that hold the parameter",
        count.share(),
        count.n,
    ));
    figures.extend(calibration(own));
    figures
}

/// Times of diagnoses, and of making their trials.
fn times(own: &[&Verdict]) -> [Figure; 6] {
    let said = own.iter().filter_map(|v| Some(v.said.as_ref()?.runtime_s));
    let said: Vec<f64> = said.collect();
    let n = said.len();
    let longer = Proportion::of(said.iter().map(|time_s| *time_s > LONGEST_DIAGNOSIS_S));
    [
        Figure::middle("median time of a diagnosis, s", said.clone()),
        Figure::new(
            "95th percentile of the time of a diagnosis, s",
            quantile(said.clone(), 0.95),
            n,
        ),
        Figure::new(
            "longest time of a diagnosis, s",
            said.into_iter().reduce(f64::max),
            n,
        ),
        Figure::count(
            &format!("diagnoses that took longer than {LONGEST_DIAGNOSIS_S} s"),
            longer,
        ),
        Figure::middle(
            "median time of a diagnosis with its program and bag, s",
            own.iter().map(|v| v.diagnosis_s).collect(),
        ),
        Figure::middle(
            "median time of making a trial, s",
            own.iter().map(|v| v.making_s).collect(),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::verdict;

    #[test]
    fn the_slow_end_of_diagnoses_is_told() {
        let verdicts: Vec<Verdict> = (1..=21)
            .map(|n| {
                let mut verdict = verdict(vec![], vec![], false);
                if let Some(said) = verdict.said.as_mut() {
                    said.runtime_s = 3.0 * f64::from(n);
                }
                verdict
            })
            .collect();
        let told = times(&verdicts.iter().collect::<Vec<_>>());
        let value = |what: &str| {
            let found = told.iter().find(|figure| figure.what == what).unwrap();
            assert_eq!(found.n, 21, "{what}");
            found.value.unwrap()
        };
        for (what, wanted) in [
            ("median time of a diagnosis, s", 33.0),
            ("95th percentile of the time of a diagnosis, s", 60.0),
            ("longest time of a diagnosis, s", 63.0),
            ("diagnoses that took longer than 60 s", 1.0),
        ] {
            assert!((value(what) - wanted).abs() < 1e-9, "{what}");
        }
    }
}
