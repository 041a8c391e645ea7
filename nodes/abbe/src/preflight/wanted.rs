//! The fewest recordings to add to a plan so that a wanted error is determined.

use anyhow::{Result, bail};
use grid_encoder::preflight::{
    Choice, PlateRules, Search, candidates, choose_beside, preflight_of,
};
use grid_encoder::recording::{Fixture, Place};
use grid_encoder::spectrum::Visibility;
use grid_encoder::unknown::Unknown;
use machine::file::{AxisEntry, GridEncoderEntry};
use metrology::sample::TestPlane;
use metrology::{Axis, PerAxis};
use nalgebra::Vector3;
use reports::evaluate::circles::plane_axes;
use reports::section::{Rows, Section, head};

use super::programme::Programme;

/// Heights at which a plate is tried, as shares of the travel.
const PLATE_HEIGHTS: [f64; 3] = [-0.6, 0.0, 0.6];
/// Radius of the smaller circle beside the largest, as its share.
const SMALLER: f64 = 0.5;

/// What to add for one wanted name.
pub struct Proposal {
    wanted: String,
    /// Coefficients that the name stands for and the plan does not determine.
    open: Vec<String>,
    list: Vec<Place>,
    choice: Choice,
}

impl Proposal {
    /// Looks for it.
    ///
    /// # Errors
    /// When no error of the model has this name, or recordings contradict each other.
    pub fn find(programme: &Programme, name: &str, offsets: &[Vector3<f64>]) -> Result<Self> {
        let is_wanted = |unknown: &Unknown| match unknown {
            Unknown::Power { component, .. } | Unknown::Knot { component, .. } => {
                component.to_string() == name || unknown.to_string() == name
            }
            _ => false,
        };
        let before = preflight_of(
            &programme.kinematics,
            &programme.recordings,
            &programme.options,
        )?;
        let named = before.unknowns.iter().zip(&before.visibility);
        let named: Vec<_> = named.filter(|(unknown, _)| is_wanted(unknown)).collect();
        if named.is_empty() {
            let mut known: Vec<String> = programme
                .options
                .components
                .iter()
                .map(|model| model.component.to_string())
                .collect();
            known.sort();
            bail!(
                "--want {name}: no error of {} has this name (known: {}, or one of their coefficients)",
                programme.kinematics.chain(),
                known.join(", ")
            );
        }
        let open = named
            .iter()
            .filter(|(_, visibility)| **visibility != Visibility::Estimable)
            .map(|(unknown, _)| unknown.to_string());
        let list = places(programme, offsets);
        let search = Search {
            station_uncertainty_mm: programme.station_uncertainty_mm,
            ..Search::default()
        };
        Ok(Self {
            wanted: name.to_owned(),
            open: open.collect(),
            choice: choose_beside(
                &programme.kinematics,
                &programme.recordings,
                &list,
                &programme.options,
                is_wanted,
                &search,
            )?,
            list,
        })
    }

    fn added(&self) -> impl Iterator<Item = &Place> {
        let idx = self.choice.recordings.iter();
        idx.filter_map(|idx| self.list.get(*idx))
    }

    /// For a terminal.
    pub fn section(&self) -> Section {
        let mut section = Section::new(format!("Wanted: {}", self.wanted));
        if self.open.is_empty() {
            section.answer("The plan determines it.".to_owned());
            return section;
        }
        section.answer(format!("The plan leaves open: {}.", self.open.join(", ")));
        let beyond: Vec<String> = self
            .choice
            .beyond_the_list
            .iter()
            .map(ToString::to_string)
            .collect();
        if !beyond.is_empty() {
            section.answer(format!(
                "No circle that was tried determines {}: another offset of the head may (--head-offset X,Y,Z).",
                beyond.join(", ")
            ));
        }
        let n = self.choice.recordings.len();
        if n > 0 {
            section.answer(if self.choice.is_least {
                format!("Fewest circles to add: {n}. Fewer of the {} that were tried do not do.", self.list.len())
            } else {
                format!("Circles to add: {n}, none of which is superfluous; that fewer would do is not excluded.")
            });
            section.tables.push(Rows {
                head: head(&["plane", "centre of the axes / mm", "R / mm", "head offset / mm", "set-up", "zero"]),
                rows: self.added().map(row).collect(),
                note: "Recordings with one number of set-up or zero are made without mounting the plate or zeroing the grid in between.".to_owned(),
            });
        }
        section
    }

    /// For machines; lengths in mm.
    pub fn figures(&self) -> serde_json::Value {
        let place = |place: &Place| {
            serde_json::json!({
                "plane": letters(place.plane),
                "centre_mm": place.centre_mm.as_slice(),
                "radius_mm": place.radius_mm,
                "head_offset_mm": place.tool_offset_mm.as_slice(),
                "setup_id": place.fixture.setup_id,
                "zero_id": place.fixture.zero_id,
            })
        };
        let beyond = self.choice.beyond_the_list.iter().map(ToString::to_string);
        serde_json::json!({
            "wanted": self.wanted,
            "open": self.open,
            "add": self.added().map(place).collect::<Vec<_>>(),
            "is_least": self.choice.is_least,
            "tried": self.list.len(),
            "beyond_what_was_tried": beyond.collect::<Vec<_>>(),
        })
    }
}

fn row(place: &Place) -> Vec<String> {
    let vector = |v: &Vector3<f64>| format!("{:.1}, {:.1}, {:.1}", v.x, v.y, v.z);
    vec![
        letters(place.plane),
        vector(&place.centre_mm),
        format!("{:.1}", place.radius_mm),
        vector(&place.tool_offset_mm),
        place.fixture.setup_id.to_string(),
        place.fixture.zero_id.to_string(),
    ]
}

fn letters(plane: TestPlane) -> String {
    plane_axes(plane).map_or_else(String::new, |[u, v]| format!("{u}{v}"))
}

/// Circles that could be added: in every plane and with every offset of the head that the machine file
/// names, all over the travel.
fn places(programme: &Programme, offsets: &[Vector3<f64>]) -> Vec<Place> {
    let file = &programme.machine;
    let Some(plate) = &file.grid_encoder else {
        return Vec::new();
    };
    let travel_mm = PerAxis::from_fn(|axis: Axis| match file.axes.get(&axis) {
        Some(AxisEntry::Linear(entry)) => entry.travel_mm.into(),
        _ => (0.0, 0.0),
    });
    let (planes, head) = mountings(plate, offsets);
    let largest_mm = programme
        .recordings
        .iter()
        .map(|recording| recording.place.radius_mm)
        .fold(0.0, f64::max);
    let radius_mm = if largest_mm > 0.0 {
        largest_mm
    } else {
        plate.radius_mm * SMALLER
    };
    let rules = PlateRules {
        planes,
        radii_mm: vec![radius_mm, radius_mm * SMALLER],
        plate_radius_mm: plate.radius_mm,
        heights: PLATE_HEIGHTS.to_vec(),
        tool_offsets_mm: head,
        rezeroed: false,
    };
    let fixtures = programme.recordings.iter().map(|r| r.place.fixture);
    let last = fixtures.fold(
        Fixture {
            zero_id: 0,
            setup_id: 0,
        },
        |last, f| Fixture {
            zero_id: last.zero_id.max(f.zero_id),
            setup_id: last.setup_id.max(f.setup_id),
        },
    );
    let mut found = candidates(&travel_mm, &rules);
    for place in &mut found {
        place.fixture.zero_id += last.zero_id;
        place.fixture.setup_id += last.setup_id;
    }
    found
}

/// Planes in which the plate is mounted, and offsets of the head: those of the machine file and `offsets`.
fn mountings(
    plate: &GridEncoderEntry,
    offsets: &[Vector3<f64>],
) -> (Vec<TestPlane>, Vec<Vector3<f64>>) {
    let mut planes: Vec<TestPlane> = Vec::new();
    let mut head: Vec<Vector3<f64>> = Vec::new();
    let known = plate.placements.iter();
    for (plane, offset) in known.map(|p| (p.plane.into(), Vector3::from(p.tool_offset_mm))) {
        if !planes.contains(&plane) {
            planes.push(plane);
        }
        if !head.contains(&offset) {
            head.push(offset);
        }
    }
    head.extend(
        offsets
            .iter()
            .filter(|o| !head.contains(o))
            .copied()
            .collect::<Vec<_>>(),
    );
    (planes, head)
}
