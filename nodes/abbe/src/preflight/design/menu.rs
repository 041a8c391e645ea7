//! The tests that a designed programme may have: each as steps of a plan, with the set-up that it stands in.
//!
//! | instrument | tests |
//! |---|---|
//! | grid encoder | circles of two radii and three feeds in both senses, lines there and back, small steps with rests |
//! | length reference | positioning at uneven targets, scans at two feeds, diagonals |
//! | probe | faces at three feeds, all faces at once and ten minutes later, artefacts, rotary poses |
//! | ballbar | circles of two feeds in each plane |
//! | any of them | a test before and after ten minutes of one axis, or of the spindle, alone |

mod bar;
mod heat;
mod planar;
mod straight;
mod touching;

use std::collections::BTreeMap;

use gap_diagnosis::design::{Bar, MOST_CANDIDATES};
use gap_diagnosis::preflight::WANTED_REPEATS;
use machine::MachineFile;
use metrology::Axis;

use super::instruments::Means;

/// What warms in a test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heat {
    /// One axis.
    Axis(Axis),
    /// The spindle.
    Spindle,
}

/// Where tests stand: one instrument in one place.
#[derive(Clone, Debug, PartialEq)]
pub struct SetUp {
    /// Its name, such as `grid middle`.
    pub name: String,
    /// The instrument.
    pub means: Means,
    /// What a person does.
    pub words: String,
}

/// One test.
#[derive(Clone, Debug, PartialEq)]
pub struct Offer {
    /// In words; unique.
    pub title: String,
    /// Where it stands.
    pub set_up: SetUp,
    /// Steps of a plan, as text.
    pub steps: Vec<String>,
    /// Programs that the steps name, with their texts.
    pub programs: BTreeMap<String, String>,
    /// How often it may be repeated.
    pub most_repeats: usize,
    /// What warms.
    pub heat: Option<Heat>,
    /// The circles, where a ballbar reads them.
    pub bar: Option<Bar>,
}

impl Offer {
    fn new(title: String, set_up: &SetUp, step: String) -> Self {
        Self {
            title,
            set_up: set_up.clone(),
            steps: vec![step],
            programs: BTreeMap::new(),
            most_repeats: WANTED_REPEATS,
            heat: None,
            bar: None,
        }
    }
}

/// Everything that a machine and its instruments allow, and how many further tests are not looked at.
pub fn offers(machine: &MachineFile) -> (Vec<Offer>, usize) {
    let mut all = touching::offers(machine);
    all.extend(straight::offers(machine));
    all.extend(planar::offers(machine));
    all.extend(bar::offers(machine));
    let warm = heat::offers(machine, &all);
    all.extend(warm);
    let more = all.len().saturating_sub(MOST_CANDIDATES);
    all.truncate(MOST_CANDIDATES);
    (all, more)
}

/// `500` or `12.5`, for titles.
fn short(value: f64) -> String {
    metrology::number::number(value)
}
