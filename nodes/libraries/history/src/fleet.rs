//! Machines of a fleet beside each other: which one differs from the others.
//!
//! ```text
//!   z = 0.6745 (x − median) / MAD                                                 (1)
//! ```
//!
//! The modified standard score of Iglewicz and Hoaglin; beyond 3.5 a machine is an outlier. Where more than half of the
//! machines have one value, the MAD is zero, and 1.2533 of the mean absolute deviation replaces MAD/0.6745.
//!
//! # References
//! [1] B. Iglewicz, D. Hoaglin, How to Detect and Handle Outliers, ASQC (1993), 3.3.

/// Fewest machines among which an outlier can be found.
pub const LEAST_MACHINES: usize = 5;
/// Score beyond which a machine is an outlier.
const OUTLYING: f64 = 3.5;
/// The median absolute deviation of a normal distribution of standard deviation 1.
const MAD_OF_NORMAL: f64 = 0.6745;
/// Standard deviation over mean absolute deviation of a normal distribution: √(π/2).
const SD_OVER_MEAN: f64 = 1.253_314;

/// One machine among others.
#[derive(Clone, Debug, PartialEq)]
pub struct Standing {
    /// Its name.
    pub machine: String,
    /// Its value.
    pub value: f64,
    /// Its score, (1); `None`: too few machines, or all alike.
    pub score: Option<f64>,
    /// Whether it is an outlier.
    pub is_outlier: bool,
}

/// Machines beside each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Fleet {
    /// Median of the values; `None`: no machine.
    pub median: Option<f64>,
    /// Each machine, in the order given.
    pub machines: Vec<Standing>,
}

/// Compares values by machine.
#[must_use]
pub fn fleet(values: &[(String, f64)]) -> Fleet {
    let median = median(values.iter().map(|(_, value)| *value));
    let scale = median
        .filter(|_| values.len() >= LEAST_MACHINES)
        .and_then(|middle| scale(values, middle));
    let standing = |(machine, value): &(String, f64)| {
        let score = median
            .zip(scale)
            .map(|(middle, scale)| (value - middle) / scale);
        Standing {
            machine: machine.clone(),
            value: *value,
            score,
            is_outlier: score.is_some_and(|score| score.abs() > OUTLYING),
        }
    };
    Fleet {
        median,
        machines: values.iter().map(standing).collect(),
    }
}

/// The robust standard deviation; `None` where all are alike.
fn scale(values: &[(String, f64)], middle: f64) -> Option<f64> {
    let deviations = || values.iter().map(|(_, value)| (value - middle).abs());
    let mad = median(deviations()).filter(|mad| *mad > 0.0);
    if let Some(mad) = mad {
        return Some(mad / MAD_OF_NORMAL);
    }
    let mean = deviations().sum::<f64>() / values.len() as f64;
    (mean > 0.0).then_some(mean * SD_OVER_MEAN)
}

/// The median; `None` of nothing.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let upper = *sorted.get(sorted.len() / 2)?;
    if sorted.len() % 2 == 1 {
        return Some(upper);
    }
    let lower = *sorted.get(sorted.len() / 2 - 1)?;
    Some(f64::midpoint(lower, upper))
}
