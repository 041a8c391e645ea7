//! What the keys of a machine are in the world of axes, feeds and temperatures.
//!
//! The mapping is a file of its own, since data item ids may have dots and colons, which a ROS parameter's name
//! cannot have:
//!
//! ```text
//! values:
//!   Xabs: {is: position, axis: X, unit: MILLIMETER}
//!   Stemp: {is: temperature, name: spindle, unit: CELSIUS, change: {step: 1.0, rate_limit_per_s: 1.0, sample_period_s: 1.5}}
//!   execution: {is: execution}
//!   spindle_c: {is: condition}
//! ```
//!
//! A key is a data item's id or its name; where an adapter puts the device before it (`mill:Xabs`), the part
//! behind the colon counts as well. Numbers of `change` are in the entry's unit, see [`crate::plausibility`].

use std::collections::{BTreeMap, BTreeSet};

use metrology::bound::Bound;
use metrology::sample::Quantity;
use metrology::stamp::Span;
use metrology::{Axis, AxisSet};
use serde::{Deserialize, Serialize};

use crate::error::MappingError;
use crate::observation::Shape;
use crate::plausibility::Rule;
use crate::possible::Possible;
use crate::unit::Unit;

/// Keys of a mapping, most of which become topics: a machine with several devices has some hundred.
const KEYS: Bound = Bound::at_most(4_000);

/// The mapping file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapFile {
    /// What each key is.
    pub values: BTreeMap<String, Meaning>,
}

/// What a key is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "is", rename_all = "snake_case", deny_unknown_fields)]
pub enum Meaning {
    /// Where an axis is.
    Position(AxisEntry),
    /// Where an axis is told to be.
    CommandedPosition(AxisEntry),
    /// Where X, Y and Z are, three numbers in one value.
    PathPosition(PathEntry),
    /// Speed along the path or of an axis.
    Feed(NumberEntry),
    /// Speed of a spindle.
    SpindleSpeed(NumberEntry),
    /// A temperature; told on `temperature/<name>` as well.
    Temperature(NumberEntry),
    /// Load of a drive.
    Load(NumberEntry),
    /// Override of a feed or a speed.
    Override(NumberEntry),
    /// Whether a program runs.
    Execution(TextEntry),
    /// Who moves the machine.
    ControllerMode(TextEntry),
    /// Text of another kind.
    Text(TextEntry),
    /// A message with a code.
    Message(TextEntry),
    /// A condition, for `/diagnostics`.
    Condition(TextEntry),
    /// Known, and not wanted.
    Ignored(Nothing),
}

/// An axis and its unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxisEntry {
    /// ISO 841 letter.
    pub axis: Axis,
    /// Unit in which it is told.
    pub unit: Unit,
}

/// A unit for X, Y and Z.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PathEntry {
    /// Unit in which they are told.
    pub unit: Unit,
}

/// A number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NumberEntry {
    /// Name of its topic; absent: the key in small letters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Unit in which it is told.
    pub unit: Unit,
    /// Whether an adapter tells it as a time series.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub series: bool,
    /// How it can change; absent: every reading is good.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub change: Option<Change>,
}

/// A text.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TextEntry {
    /// Name of its topic or condition; absent: the key in small letters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The text that replaces a value, such as a number of an enumeration; other values stay as they are.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub words: BTreeMap<String, String>,
}

/// No keys.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Nothing {}

/// How a value can change, in its entry's unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Change {
    /// Resolution.
    pub step: f64,
    /// Fastest change in a second.
    pub rate_limit_per_s: f64,
    /// The machine looks this often, s.
    pub sample_period_s: f64,
    /// A step that has held this long is true, s.
    #[serde(default = "Change::default_confirm_s")]
    pub confirm_s: f64,
}

impl Change {
    const fn default_confirm_s() -> f64 {
        60.0
    }
}

/// What is done with the values of a key.
#[derive(Clone, Debug, PartialEq)]
pub enum Use {
    /// Position of these axes, in order; factor to the inner unit.
    Position {
        /// Axes, one number each.
        axes: Vec<Axis>,
        /// Whether it is the commanded one.
        commanded: bool,
        /// Factor to mm or rad.
        factor: f64,
    },
    /// A number on a topic.
    Number {
        /// Topic.
        name: String,
        /// What it is.
        quantity: Quantity,
        /// Factor and offset to the inner unit.
        to_inner: (f64, f64),
        /// How it can change.
        rule: Option<Rule>,
        /// Whether an adapter tells a series.
        series: bool,
    },
    /// A text on a topic.
    Text {
        /// Topic.
        name: String,
        /// What it is.
        quantity: Quantity,
        /// Whether a code stands before it.
        is_message: bool,
        /// The text that replaces a value.
        words: BTreeMap<String, String>,
    },
    /// A condition.
    Alarm {
        /// Name.
        name: String,
    },
    /// Nothing.
    Nothing,
}

impl Use {
    /// The number as it is inside.
    #[must_use]
    pub fn inner(&self, number: f64) -> f64 {
        match self {
            Self::Position { factor, .. } => number * factor,
            Self::Number {
                to_inner: (factor, offset),
                ..
            } => number * factor + offset,
            _ => number,
        }
    }

    /// The text that replaces this one.
    #[must_use]
    pub fn word(&self, text: String) -> String {
        match self {
            Self::Text { words, .. } => words.get(&text).cloned().unwrap_or(text),
            _ => text,
        }
    }

    /// What it would have to be, where it cannot be this number.
    #[must_use]
    pub fn refuses(&self, number: f64) -> Option<Possible> {
        Possible::of(self).filter(|possible| !possible.holds(self.inner(number)))
    }

    /// How an adapter's line tells it.
    #[must_use]
    pub const fn shape(&self) -> Shape {
        match self {
            Self::Alarm { .. } => Shape::Condition,
            Self::Text {
                is_message: true, ..
            } => Shape::Message,
            Self::Number { series: true, .. } => Shape::Series,
            _ => Shape::Value,
        }
    }
}

/// The mapping, checked, in inner units.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mapping {
    uses: BTreeMap<String, Use>,
    units: BTreeMap<String, Unit>,
}

impl MapFile {
    /// Reads a mapping file.
    ///
    /// # Errors
    /// When a key is unknown, missing or of the wrong type; the message has line and column.
    pub fn from_yaml(text: &str) -> Result<Self, MappingError> {
        metrology::yaml::read_letters(text).map_err(MappingError::MapFile)
    }
}

/// A topic's name out of a key.
#[must_use]
pub fn name_of(key: &str) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() {
            c.to_ascii_lowercase()
        } else {
            '_'
        }
    };
    let mut name: String = key.chars().map(plain).collect();
    while name.contains("__") {
        name = name.replace("__", "_");
    }
    let name = name.trim_matches('_');
    if name.starts_with(|c: char| c.is_ascii_digit()) {
        format!("v_{name}")
    } else {
        name.to_owned()
    }
}

fn is_name(name: &str) -> bool {
    let starts_well = name.starts_with(|c: char| c.is_ascii_lowercase());
    let holds_only = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    starts_well && name.chars().all(holds_only) && !name.contains("__")
}

fn rule(key: &str, change: &Change, unit: Unit) -> Result<Rule, MappingError> {
    let factor = unit.to_inner().0;
    let checked = |field: &'static str, value: f64, least: f64, greatest: f64| {
        if value >= least && value <= greatest {
            Ok(value)
        } else {
            Err(MappingError::Change {
                key: key.to_owned(),
                field,
                value,
                least,
                greatest,
            })
        }
    };
    let period_s = checked("sample_period_s", change.sample_period_s, 0.001, 3600.0)?;
    Ok(Rule {
        step: checked("step", change.step, 0.0, 1e9)? * factor,
        rate_limit_per_s: checked("rate_limit_per_s", change.rate_limit_per_s, 1e-9, 1e9)? * factor,
        sample_period: Span::from_secs_f64(period_s),
        confirm: Span::from_secs_f64(checked("confirm_s", change.confirm_s, period_s, 86_400.0)?),
    })
}

impl Mapping {
    /// Checks a mapping.
    ///
    /// # Errors
    /// A unit that does not measure what it is said to, a name that is no topic's or told twice, an axis told
    /// twice, a rule out of range, more keys than a machine has.
    pub fn new(file: &MapFile) -> Result<Self, MappingError> {
        let (mut uses, mut units) = (BTreeMap::new(), BTreeMap::new());
        KEYS.check_amount(|| "values".to_owned(), "keys", file.values.len())?;
        for (key, meaning) in &file.values {
            if key.trim().is_empty() {
                return Err(MappingError::Name {
                    key: "values".to_owned(),
                    name: key.clone(),
                    reason: "no data item has an empty key: write its id, or take the key out",
                });
            }
            uses.insert(key.clone(), meaning.checked(key)?);
            units.extend(meaning.unit().map(|unit| (key.clone(), unit)));
        }
        let mapping = Self { uses, units };
        mapping.check_names()?;
        mapping.check_axes()?;
        Ok(mapping)
    }

    fn check_names(&self) -> Result<(), MappingError> {
        let mut seen = BTreeSet::new();
        for (key, used) in &self.uses {
            let name = match used {
                Use::Number { name, .. } | Use::Text { name, .. } => (name, false),
                Use::Alarm { name } => (name, true),
                Use::Position { .. } | Use::Nothing => continue,
            };
            let fault = |reason| MappingError::Name {
                key: key.clone(),
                name: name.0.clone(),
                reason,
            };
            if !is_name(name.0) {
                return Err(fault(
                    "must be small letters, digits and single underscores",
                ));
            }
            if !seen.insert(name) {
                return Err(fault("another key has it"));
            }
        }
        Ok(())
    }

    fn check_axes(&self) -> Result<(), MappingError> {
        let (mut actual, mut wanted) = (AxisSet::default(), AxisSet::default());
        for (key, used) in &self.uses {
            let Use::Position {
                axes, commanded, ..
            } = used
            else {
                continue;
            };
            let seen = if *commanded { &mut wanted } else { &mut actual };
            for axis in axes {
                if seen.contains(*axis) {
                    return Err(MappingError::AxisTwice {
                        key: key.clone(),
                        axis: *axis,
                    });
                }
                *seen = seen.with(*axis);
            }
        }
        match wanted.iter().find(|axis| !actual.contains(*axis)) {
            Some(axis) => Err(MappingError::CommandedAlone { axis }),
            None => Ok(()),
        }
    }

    /// The key of the mapping that stands for a told one, by its id, its name, or what stands behind a colon.
    #[must_use]
    pub fn find(&self, key: &str, name: Option<&str>) -> Option<(&str, &Use)> {
        let behind = key.rsplit_once(':').map(|(_, behind)| behind);
        let tried = [Some(key), name, behind].into_iter().flatten();
        tried
            .filter_map(|key| self.uses.get_key_value(key))
            .map(|(key, used)| (key.as_str(), used))
            .next()
    }

    /// The unit of a key of the mapping; `None`: it is no number.
    #[must_use]
    pub fn unit(&self, key: &str) -> Option<Unit> {
        self.units.get(key).copied()
    }

    /// Every key with its use.
    pub fn uses(&self) -> impl Iterator<Item = (&str, &Use)> {
        self.uses.iter().map(|(key, used)| (key.as_str(), used))
    }

    /// Whether an axis is told.
    #[must_use]
    pub fn has_axes(&self) -> bool {
        let is_position = |used: &Use| matches!(used, Use::Position { .. });
        self.uses.values().any(is_position)
    }

    /// The axes with a commanded position, or with an actual one.
    #[must_use]
    pub fn axes(&self, wanted_commanded: bool) -> AxisSet {
        let told = self.uses.values().filter_map(move |used| match used {
            Use::Position {
                axes, commanded, ..
            } if *commanded == wanted_commanded => Some(axes.iter()),
            _ => None,
        });
        told.flatten().copied().collect()
    }

    /// The axes of which no commanded position is told.
    #[must_use]
    pub fn uncommanded(&self) -> AxisSet {
        let commanded = self.axes(true);
        self.axes(false)
            .iter()
            .filter(|axis| !commanded.contains(*axis))
            .collect()
    }
}

impl Meaning {
    /// Gives it the name of its topic or condition; a position has none.
    pub fn set_name(&mut self, new: String) {
        match self {
            Self::Feed(entry)
            | Self::SpindleSpeed(entry)
            | Self::Temperature(entry)
            | Self::Load(entry)
            | Self::Override(entry) => entry.name = Some(new),
            Self::Execution(entry)
            | Self::ControllerMode(entry)
            | Self::Text(entry)
            | Self::Message(entry)
            | Self::Condition(entry) => entry.name = Some(new),
            Self::Position(_)
            | Self::CommandedPosition(_)
            | Self::PathPosition(_)
            | Self::Ignored(_) => {}
        }
    }
    const fn unit(&self) -> Option<Unit> {
        match self {
            Self::Position(entry) | Self::CommandedPosition(entry) => Some(entry.unit),
            Self::PathPosition(entry) => Some(entry.unit),
            Self::Feed(entry)
            | Self::SpindleSpeed(entry)
            | Self::Temperature(entry)
            | Self::Load(entry)
            | Self::Override(entry) => Some(entry.unit),
            _ => None,
        }
    }

    fn checked(&self, key: &str) -> Result<Use, MappingError> {
        let named = |name: &Option<String>| name.clone().unwrap_or_else(|| name_of(key));
        let text = |entry: &TextEntry, quantity, is_message| Use::Text {
            name: named(&entry.name),
            quantity,
            is_message,
            words: entry.words.clone(),
        };
        Ok(match self {
            Self::Position(entry) => entry.checked(key, false)?,
            Self::CommandedPosition(entry) => entry.checked(key, true)?,
            Self::PathPosition(entry) => Use::Position {
                axes: Axis::LINEAR.to_vec(),
                commanded: false,
                factor: position_factor(key, entry.unit, true)?,
            },
            Self::Feed(entry) => entry.checked(key, Quantity::Feed)?,
            Self::SpindleSpeed(entry) => entry.checked(key, Quantity::SpindleSpeed)?,
            Self::Temperature(entry) => entry.checked(key, Quantity::Temperature)?,
            Self::Load(entry) => entry.checked(key, Quantity::Load)?,
            Self::Override(entry) => entry.checked(key, Quantity::Override)?,
            Self::Execution(entry) => text(entry, Quantity::Execution, false),
            Self::ControllerMode(entry) => text(entry, Quantity::ControllerMode, false),
            Self::Text(entry) => text(entry, Quantity::Text, false),
            Self::Message(entry) => text(entry, Quantity::Text, true),
            Self::Condition(entry) if !entry.words.is_empty() => {
                return Err(MappingError::Words {
                    key: key.to_owned(),
                });
            }
            Self::Condition(entry) => Use::Alarm {
                name: named(&entry.name),
            },
            Self::Ignored(_) => Use::Nothing,
        })
    }
}

fn position_factor(key: &str, unit: Unit, is_linear: bool) -> Result<f64, MappingError> {
    if unit.measures_position(is_linear) {
        Ok(unit.to_inner().0)
    } else {
        Err(MappingError::Unit {
            key: key.to_owned(),
            unit: unit.word(),
            what: if is_linear {
                "a linear axis"
            } else {
                "a rotary axis"
            },
        })
    }
}

impl AxisEntry {
    fn checked(&self, key: &str, commanded: bool) -> Result<Use, MappingError> {
        Ok(Use::Position {
            axes: vec![self.axis],
            commanded,
            factor: position_factor(key, self.unit, self.axis.is_linear())?,
        })
    }
}

impl NumberEntry {
    fn checked(&self, key: &str, quantity: Quantity) -> Result<Use, MappingError> {
        if !self.unit.measures(quantity) {
            return Err(MappingError::Unit {
                key: key.to_owned(),
                unit: self.unit.word(),
                what: match quantity {
                    Quantity::Feed => "a feed",
                    Quantity::SpindleSpeed => "a spindle speed",
                    Quantity::Temperature => "a temperature",
                    _ => "a share",
                },
            });
        }
        let rule = self
            .change
            .as_ref()
            .map(|change| rule(key, change, self.unit));
        Ok(Use::Number {
            name: self.name.clone().unwrap_or_else(|| name_of(key)),
            quantity,
            to_inner: self.unit.to_inner(),
            rule: rule.transpose()?,
            series: self.series,
        })
    }
}

#[cfg(test)]
mod tests;
