//! Limits of one figure, in the unit that their keys end with.

use metrology::number::quantity;
use schemars::JsonSchema;
use serde::Deserialize;

/// Limits of one figure; at least one.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Limit {
    /// Least length that conforms.
    pub lower_um: Option<f64>,
    /// Greatest length that conforms.
    pub upper_um: Option<f64>,
    /// Least angle that conforms.
    pub lower_arcsec: Option<f64>,
    /// Greatest angle that conforms.
    pub upper_arcsec: Option<f64>,
    /// Least value that conforms, of a figure that is neither length nor angle, in its own unit.
    pub lower: Option<f64>,
    /// Greatest value that conforms, of a figure that is neither length nor angle, in its own unit.
    pub upper: Option<f64>,
}

/// Greatest magnitude of a limit of a length, µm: a metre.
const GREATEST_UM: f64 = 1e6;
/// Greatest magnitude of a limit of an angle, arcsec: a turn.
const GREATEST_ARCSEC: f64 = 1_296_000.0;
/// Greatest magnitude of another limit: that of a figure in a history.
const GREATEST_OTHER: f64 = 1e12;

/// Figures that are never negative, by the last part of their names.
pub(super) const NEVER_NEGATIVE: [&str; 6] = [
    "accuracy",
    "repeatability",
    "systematic_error",
    "mean_systematic_error",
    "reversal",
    "circular_error",
];

/// Lower and upper limit, the ending of their keys, and the greatest magnitude.
type Family = (Option<f64>, Option<f64>, &'static str, f64);

impl Limit {
    fn families(self) -> [Family; 3] {
        [
            (self.lower_um, self.upper_um, "_um", GREATEST_UM),
            (
                self.lower_arcsec,
                self.upper_arcsec,
                "_arcsec",
                GREATEST_ARCSEC,
            ),
            (self.lower, self.upper, "", GREATEST_OTHER),
        ]
    }

    /// Refuses limits that are no numbers of a machine, or leave no zone; `place` is their key.
    pub fn check(self, place: &str) -> Result<(), String> {
        for (lower, upper, unit, greatest) in self.families() {
            for (side, value) in [("lower", lower), ("upper", upper)] {
                let Some(value) = value else { continue };
                if !(-greatest..=greatest).contains(&value) {
                    let key = format!("{place}.{side}{unit}");
                    let [value, least, greatest] =
                        [value, -greatest, greatest].map(|one| quantity(&key, one));
                    return Err(format!(
                        "{key} = {value}: must be from {least} to {greatest}"
                    ));
                }
            }
            if let (Some(lower), Some(upper)) = (lower, upper)
                && lower >= upper
            {
                let key = format!("{place}.lower{unit}");
                let [lower, upper] = [lower, upper].map(|one| quantity(&key, one));
                return Err(format!(
                    "{key} = {lower}: must be below upper{unit} = {upper}: exchange them"
                ));
            }
            let last = place.rsplit('.').next().unwrap_or(place);
            if let Some(upper) = upper.filter(|upper| *upper <= 0.0)
                && NEVER_NEGATIVE.contains(&last)
            {
                let key = format!("{place}.upper{unit}");
                let upper = quantity(&key, upper);
                return Err(format!(
                    "{key} = {upper}: must be above 0, for the figure is never negative: nothing would conform"
                ));
            }
        }
        let there = self.families().map(|(lower, upper, ..)| lower.or(upper));
        match there.map(|one| one.is_some()) {
            [false, false, false] => Err(format!(
                "{place}: has no limit: state lower_um or upper_um (µm), of an angle lower_arcsec or upper_arcsec, of another figure lower or upper"
            )),
            [true, true, _] => Err(format!(
                "{place}: has limits in µm and in arcsec: a figure is a length or an angle, remove one"
            )),
            [true, _, true] | [_, true, true] => Err(format!(
                "{place}: has limits with a unit and without: a figure has one unit, remove one"
            )),
            _ => Ok(()),
        }
    }

    /// Lower and upper limit in the unit of a figure: mm, um, rad, arcsec, or another one; otherwise which keys it needs.
    pub fn in_unit(self, unit: &str) -> Result<[Option<f64>; 2], &'static str> {
        const ARCSEC_RAD: f64 = std::f64::consts::PI / 648_000.0;
        let (factor, lower, upper) = match unit {
            "mm" => (1e-3, self.lower_um, self.upper_um),
            "um" => (1.0, self.lower_um, self.upper_um),
            "rad" => (ARCSEC_RAD, self.lower_arcsec, self.upper_arcsec),
            "arcsec" => (1.0, self.lower_arcsec, self.upper_arcsec),
            _ => (1.0, self.lower, self.upper),
        };
        if lower.or(upper).is_some() {
            return Ok([lower, upper].map(|one| one.map(|value| value * factor)));
        }
        Err(match unit {
            "mm" | "um" => "is a length: lower_um and upper_um limit it",
            "rad" | "arcsec" => "is an angle: lower_arcsec and upper_arcsec limit it",
            _ => "is neither length nor angle: lower and upper limit it, in its own unit",
        })
    }
}
