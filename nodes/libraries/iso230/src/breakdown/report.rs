//! What a breakdown says.

use serde::{Deserialize, Serialize};

use super::cross_check::CrossCheck;
use super::recording::{CircularPlane, CircularSense};
use super::term::RowKey;
use metrology::Axis;

/// Unit of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the names are the units")]
pub enum Unit {
    Mm,
    MmPerMm,
    Rad,
    S,
    S2,
    PerMm,
    MmPerS,
    Hz,
    LobesPerTurn,
}

/// Something that belongs to a row beside its value: phase, decay, frequency.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Detail {
    /// What.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Its standard uncertainty; none where it is not estimated.
    pub standard_uncertainty: Option<f64>,
    /// Unit of both.
    pub unit: Unit,
}

/// Another cause that the data cannot tell apart from a row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Alias {
    /// The cause.
    pub key: RowKey,
    /// Its name.
    pub name: String,
    /// What one unit of it adds to the row's value, in unit of the row per unit of it.
    pub coefficient: f64,
    /// Its unit.
    pub unit: Unit,
    /// What would tell it apart: each list alone suffices; none is known where there is no list.
    pub needed: Vec<Vec<Needed>>,
}

/// What would have to be recorded or known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Needed {
    /// A circle the other way round.
    OtherSense,
    /// A circle at another feed, the reference left as it was.
    OtherFeed,
    /// A circle of another radius.
    OtherRadius,
    /// A circle of another radius, without setting the reference to zero anew.
    OtherRadiusSameZero,
    /// A whole turn.
    FullCircle,
    /// A calibrated reference length.
    CalibratedReference,
}

impl Needed {
    /// All, the easiest first.
    pub const ALL: [Self; 6] = [
        Self::OtherSense,
        Self::OtherFeed,
        Self::OtherRadius,
        Self::OtherRadiusSameZero,
        Self::FullCircle,
        Self::CalibratedReference,
    ];
}

/// One row: a cause, or a combination that the data cannot split.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// The cause; the first one of a combination.
    pub key: RowKey,
    /// Name; of a combination all names, joined by `+` or `−` as they add up.
    pub name: String,
    /// Value; of a combination value of `key` + Σ coefficient × alias.
    pub value: f64,
    /// Standard uncertainty of the value: of the fit, with the errors of the instruments where they are stated.
    pub standard_uncertainty: f64,
    /// That of the fit alone.
    pub standard_uncertainty_of_fit: f64,
    /// Unit of all three.
    pub unit: Unit,
    /// Phase, decay and the like.
    pub details: Vec<Detail>,
    /// Causes that are in the value as well. Empty: the row is told apart.
    pub aliases: Vec<Alias>,
    /// Probability that chance alone makes the row at least as large.
    pub chance: f64,
    /// Greatest span of the row alone on one trace, the nominal circle included, mm.
    pub peak_to_peak_mm: f64,
    /// Share of the span in the sum of all spans, percent.
    pub share_percent: f64,
    /// Shapley share of the row in the squared deviation of the traces, percent; may be below 0.
    pub variance_share_percent: f64,
    /// Squared deviation that is explained by nothing else, percent.
    pub incremental_percent: f64,
    /// Circularity of each trace without the row, mm.
    pub circularity_without_mm: Vec<f64>,
    /// The greatest of them, mm.
    pub worst_circularity_without_mm: f64,
    /// Where to look.
    pub cause: String,
}

/// Something that was looked for in vain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NotFound {
    /// What.
    pub name: String,
    /// Amplitude that would have been found, mm; none where the samples are too far apart to see it.
    pub detectable_mm: Option<f64>,
}

/// What is left when all rows are taken out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// Standard deviation of the fast part, by differences of third order, mm.
    pub high_pass_mm: f64,
    /// Standard deviation of the residuals, mm.
    pub residual_mm: f64,
    /// Mean square difference of neighbours over twice the variance: 1 is white, below 1 drags on.
    pub whiteness: f64,
    /// Deviation of `whiteness` from 1 in its own standard deviations.
    pub whiteness_score: f64,
    /// Factor by which variances were enlarged because residuals drag on.
    pub inflation: f64,
}

/// One recording as the breakdown saw it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordingSummary {
    /// Place in the caller's list.
    pub recording: usize,
    /// Which way round.
    pub sense: CircularSense,
    /// Stated feed, mm/s.
    pub feed_mm_s: f64,
    /// Feed by angle and time, mm/s.
    pub measured_feed_mm_s: f64,
    /// Nominal radius, mm.
    pub radius_mm: f64,
    /// Samples.
    pub n_samples: usize,
    /// Single samples left out as spikes of the reader.
    pub n_outliers: usize,
    /// Samples that weighed less.
    pub n_downweighted: usize,
    /// Circular error G about the least-squares centre, ISO 230-4, mm.
    pub circularity_mm: f64,
    /// Circularity of what no row explains, mm.
    pub residual_circularity_mm: f64,
}

/// Breakdown of one plane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaneBreakdown {
    /// Plane.
    pub plane: CircularPlane,
    /// First and second axis.
    pub axes: [Axis; 2],
    /// Causes, the greatest span first.
    pub rows: Vec<Row>,
    /// Centres and reference lengths.
    pub setting_up: Vec<Row>,
    /// What the recordings do not show at all.
    pub unseen: Vec<Alias>,
    /// Spikes, cyclic errors and tones that were not found.
    pub not_found: Vec<NotFound>,
    /// The recordings.
    pub recordings: Vec<RecordingSummary>,
    /// What is left.
    pub noise: Noise,
    /// Scale of each axis (mm/mm) with its standard uncertainty, where reference and feeds allow it.
    pub scales: Option<[(f64, f64); 2]>,
    /// The robust figures, one of each recording.
    pub cross_checks: Vec<CrossCheck>,
    /// Four-point squareness, the component of ISO 230-1, averaged over senses, rad; none where one sense or an angle is missing.
    pub four_point_squareness_rad: Option<f64>,
    /// Greatest circularity, mm.
    pub worst_circularity_mm: f64,
}

/// Breakdown of all planes that were recorded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Breakdown {
    /// One for each plane, XY first.
    pub planes: Vec<PlaneBreakdown>,
}

impl PlaneBreakdown {
    /// The row of a cause, alone or first of a combination.
    #[must_use]
    pub fn row(&self, key: &RowKey) -> Option<&Row> {
        self.rows
            .iter()
            .chain(&self.setting_up)
            .find(|row| row.key == *key)
    }

    /// The rows in whose value a cause is, alone or not.
    pub fn rows_with<'a>(&'a self, key: &'a RowKey) -> impl Iterator<Item = &'a Row> {
        let rows = self.rows.iter().chain(&self.setting_up);
        rows.filter(move |row| row.key == *key || row.aliases.iter().any(|a| a.key == *key))
    }
}
