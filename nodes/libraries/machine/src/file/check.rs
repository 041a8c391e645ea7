//! What must hold in a machine file beyond its syntax.

use std::collections::{BTreeMap, BTreeSet};

use metrology::{Axis, Bound, leaves};
use nalgebra::Vector3;

use super::{
    ArtefactEntry, AxisEntry, BlockEntry, LinearAxisEntry, MachineFile, PositionFeedback,
    StylusEntry, effect_ranges, limits, reference,
};
use crate::chain::Chain;
use crate::cycle::artefact_id;
use crate::error::MachineFileError;

/// Nearer corners are those of one block, mm.
const SAME_CORNER_MM: f64 = 1.0;
const LEADS: &str =
    "must be from 0.2 to 500 mm, the leads of screws and racks: state it in mm, not in m or µm";
const BALL_RADII: &str =
    "must be from 0.02 to 30 mm, the radii of styli: state it in mm, not in m or µm";
const STYLUS_LENGTHS: &str =
    "must be from 1 to 3000 mm, the lengths of styli: state it in mm, not in m or µm";
const FINITE: &str = "must be a finite number";
/// Magnitude of any number of the file, in the unit of its key: products of a few of them stay finite.
const GREATEST_NUMBER: f64 = 1e12;
const IN_MAGNITUDE: &str = "must be at most 1e12 in magnitude";
/// Blocks, artefacts, styli, thermometers, placements, beams or effects: a machine has tens; each is planned for, and each
/// thermometer is a topic.
const ENTRIES: Bound = Bound::at_most(1_000);
/// Length of an id in bytes: it is a part of topics, frames and messages.
const ID_BYTES: Bound = Bound::at_most(128);
const ROS_NAME: &str =
    "must begin with a letter and consist of letters, digits and single underscores";

impl MachineFile {
    /// Checks every value; `source_name` stands in the errors.
    ///
    /// # Errors
    /// The first rule that is broken, with its key and value.
    pub fn check(&self, source_name: &str) -> Result<(), MachineFileError> {
        let check = Check { source_name };
        check.amounts(self)?;
        check.ros_name("name", &self.name)?;
        check.sizes(self)?;
        check.physics(self)?;
        for (axis, entry) in &self.axes {
            let key = format!("axes.{axis}");
            match entry {
                AxisEntry::Linear(entry) => {
                    check.travel(&format!("{key}.travel_mm"), entry.travel_mm)?;
                }
                AxisEntry::Rotary(entry) => {
                    check.travel(&format!("{key}.travel_deg"), entry.travel_deg)?;
                }
            }
            check.kind(*axis, entry)?;
        }
        check.chain(self)?;
        check.origins(self)?;
        check.probe(self)?;
        check.features(self)?;
        check.certificates(self)?;
        check.sensors(self)?;
        let (grid, length) = (self.grid_encoder.as_ref(), self.length_reference.as_ref());
        reference::check(&check, grid, length)?;
        check.effects(self)
    }
}

pub(super) struct Check<'a> {
    source_name: &'a str,
}

impl Check<'_> {
    pub(super) fn number(
        &self,
        key: &str,
        value: f64,
        holds: bool,
        rule: &'static str,
    ) -> Result<(), MachineFileError> {
        let is_small = value.abs() <= GREATEST_NUMBER;
        if holds && is_small {
            return Ok(());
        }
        let rule = if holds && value.is_finite() {
            IN_MAGNITUDE
        } else {
            rule
        };
        Err(MachineFileError::Number {
            source_name: self.source_name.to_owned(),
            key: key.to_owned(),
            value,
            rule,
        })
    }

    /// Refuses physical numbers that no machine has; those of effects have the ranges of their kinds.
    fn physics(&self, file: &MachineFile) -> Result<(), MachineFileError> {
        let physical = MachineFile {
            effects: vec![],
            ..file.clone()
        };
        leaves::check(limits::ROWS, &physical).map_err(|source| self.bound(source))
    }

    fn bound(&self, source: metrology::BoundError) -> MachineFileError {
        MachineFileError::Bound {
            source_name: self.source_name.to_owned(),
            source,
        }
    }

    /// Refuses lists that are too long before anything is made of them.
    fn amounts(&self, file: &MachineFile) -> Result<(), MachineFileError> {
        let grid = file.grid_encoder.as_ref();
        let length = file.length_reference.as_ref();
        let lists = [
            ("blocks", file.blocks.len()),
            ("artefacts", file.artefacts.len()),
            ("certificates", file.certificates.len()),
            ("probe.styli", file.probe.styli.len()),
            ("temperature_sensors", file.temperature_sensors.len()),
            ("effects", file.effects.len()),
            (
                "grid_encoder.placements",
                grid.map_or(0, |grid| grid.placements.len()),
            ),
            (
                "length_reference.beams",
                length.map_or(0, |length| length.beams.len()),
            ),
        ];
        let refuse = |key: &dyn Fn() -> String, n| {
            let checked = ENTRIES.check_amount(key, "entries", n);
            checked.map_err(|source| self.bound(source))
        };
        for (key, n) in lists {
            refuse(&|| key.to_owned(), n)?;
        }
        for (axis, entry) in &file.axes {
            if let AxisEntry::Linear(linear) = entry {
                refuse(
                    &|| format!("axes.{axis}.periods_mm"),
                    linear.periods_mm.len(),
                )?;
            }
        }
        Ok(())
    }

    fn travel(&self, key: &str, [least, greatest]: [f64; 2]) -> Result<(), MachineFileError> {
        if least < greatest {
            return Ok(());
        }
        Err(MachineFileError::Order {
            source_name: self.source_name.to_owned(),
            key: key.to_owned(),
            least,
            greatest,
        })
    }

    pub(super) fn name(
        &self,
        key: &str,
        name: &str,
        holds: bool,
        rule: &'static str,
    ) -> Result<(), MachineFileError> {
        if holds {
            return Ok(());
        }
        Err(MachineFileError::Name {
            source_name: self.source_name.to_owned(),
            key: key.to_owned(),
            name: name.to_owned(),
            rule,
        })
    }

    fn ros_name(&self, key: &str, name: &str) -> Result<(), MachineFileError> {
        ID_BYTES
            .check_amount(|| key.to_owned(), "bytes of text", name.len())
            .map_err(|source| self.bound(source))?;
        let legal = name.starts_with(|c: char| c.is_ascii_alphabetic())
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
            && !name.contains("__");
        self.name(key, name, legal, ROS_NAME)
    }

    fn axis(&self, axis: Axis, rule: &'static str) -> MachineFileError {
        MachineFileError::Axis {
            source_name: self.source_name.to_owned(),
            axis,
            rule,
        }
    }

    fn kind(&self, axis: Axis, entry: &AxisEntry) -> Result<(), MachineFileError> {
        match (axis.is_linear(), entry) {
            (true, AxisEntry::Linear(linear)) => {
                let by_scale = linear.position_feedback == PositionFeedback::Scale;
                if by_scale && linear.scale_resolution_um.is_none() {
                    let rule = "has position_feedback: scale, and no scale_resolution_um";
                    return Err(self.axis(axis, rule));
                }
                self.scale(axis, linear)
            }
            (false, AxisEntry::Rotary(_)) => Ok(()),
            (true, AxisEntry::Rotary(_)) => Err(self.axis(axis, "X Y Z are linear axes")),
            (false, AxisEntry::Linear(_)) => Err(self.axis(axis, "A B C are rotary axes")),
        }
    }

    /// What a scale's certificate and data sheet state needs the scale, and the certificate both of its parts.
    fn scale(&self, axis: Axis, linear: &LinearAxisEntry) -> Result<(), MachineFileError> {
        let constant = linear.scale_expanded_uncertainty_um.is_some();
        let growing = linear.scale_expanded_uncertainty_um_per_m.is_some();
        let described = constant || growing || linear.scale_signal_period_um.is_some();
        if described && linear.scale_resolution_um.is_none() {
            let rule = "describes a linear scale, and has no scale_resolution_um";
            return Err(self.axis(axis, rule));
        }
        if constant != growing {
            let rule = "needs both scale_expanded_uncertainty_um and scale_expanded_uncertainty_um_per_m, or neither";
            return Err(self.axis(axis, rule));
        }
        Ok(())
    }

    fn chain(&self, file: &MachineFile) -> Result<(), MachineFileError> {
        let chain: Chain = file
            .chain
            .parse()
            .map_err(|error| MachineFileError::Chain {
                source_name: self.source_name.to_owned(),
                error,
            })?;
        for axis in Axis::ALL {
            match (chain.axes().contains(axis), file.axes.contains_key(&axis)) {
                (true, false) => {
                    return Err(self.axis(axis, "stands in the chain but is not described"));
                }
                (false, true) => {
                    return Err(self.axis(axis, "is described but does not stand in the chain"));
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn origins(&self, file: &MachineFile) -> Result<(), MachineFileError> {
        for axis in Axis::ROTARY {
            let origin = file.rotary.as_ref().and_then(|r| r.origin_mm.get(&axis));
            match (file.axes.contains_key(&axis), origin) {
                (true, None) => {
                    return Err(self.axis(axis, "needs a point on its line in rotary.origin_mm"));
                }
                (false, Some(_)) => {
                    return Err(self.axis(axis, "stands in rotary.origin_mm but is not described"));
                }
                (true, Some(_)) | (false, None) => {}
            }
        }
        let linear = file
            .rotary
            .iter()
            .flat_map(|rotary| rotary.origin_mm.keys())
            .find(|axis| axis.is_linear());
        match linear {
            Some(axis) => Err(self.axis(*axis, "is linear and has no place in rotary.origin_mm")),
            None => Ok(()),
        }
    }

    fn probe(&self, file: &MachineFile) -> Result<(), MachineFileError> {
        let probe = &file.probe;
        for name in probe.styli.keys() {
            self.ros_name(&format!("probe.styli.{name}"), name)?;
        }
        self.stems(&probe.styli)?;
        let known = probe.styli.contains_key(&probe.mounted);
        let rule = "must be one of probe.styli";
        self.name("probe.mounted", &probe.mounted, known, rule)
    }

    /// Refuses leads of axes and sizes of styli that none has: a slip of m or µm.
    fn sizes(&self, file: &MachineFile) -> Result<(), MachineFileError> {
        for (axis, entry) in &file.axes {
            if let AxisEntry::Linear(linear) = entry {
                let holds = limits::LEAD_MM.contains(&linear.lead_mm);
                let key = format!("axes.{axis}.lead_mm");
                self.number(&key, linear.lead_mm, holds, LEADS)?;
            }
        }
        for (name, stylus) in &file.probe.styli {
            let stem_mm = stylus.stem_length_mm.unwrap_or(stylus.length_mm);
            let lengths = limits::STYLUS_LENGTH_MM;
            for (key, mm, range, rule) in [
                (
                    "radius_mm",
                    stylus.radius_mm,
                    limits::BALL_RADIUS_MM,
                    BALL_RADII,
                ),
                (
                    "length_mm",
                    stylus.length_mm,
                    lengths.clone(),
                    STYLUS_LENGTHS,
                ),
                ("stem_length_mm", stem_mm, lengths, STYLUS_LENGTHS),
            ] {
                let key = format!("probe.styli.{name}.{key}");
                self.number(&key, mm, range.contains(&mm), rule)?;
            }
        }
        Ok(())
    }

    /// Stems are compared with one another, so each stylus states its own or none does.
    fn stems(&self, styli: &BTreeMap<String, StylusEntry>) -> Result<(), MachineFileError> {
        let is_any = styli.values().any(|one| one.stem_length_mm.is_some());
        for (name, stylus) in styli.iter().filter(|_| is_any) {
            let key = format!("probe.styli.{name}.stem_length_mm");
            let Some(stem_mm) = stylus.stem_length_mm else {
                return self.name(&key, "", false, "must be given of each stylus or of none");
            };
            let rule = "must be at most length_mm, which reaches from the spindle nose to the ball";
            self.number(&key, stem_mm, stem_mm <= stylus.length_mm, rule)?;
        }
        Ok(())
    }

    fn features(&self, file: &MachineFile) -> Result<(), MachineFileError> {
        let mut ids = BTreeSet::new();
        for (index, block) in file.blocks.iter().enumerate() {
            let key = format!("blocks[{index}]");
            self.block(&key, block)?;
            self.new_id(&format!("{key}.id"), &block.id, &mut ids)?;
            self.own_place(&key, block, file.blocks.iter().take(index))?;
        }
        for (index, artefact) in file.artefacts.iter().enumerate() {
            let key = format!("artefacts[{index}]");
            self.artefact(&key, artefact)?;
            self.new_id(&format!("{key}.id"), artefact_id(artefact), &mut ids)?;
        }
        Ok(())
    }

    pub(super) fn new_id<'a>(
        &self,
        key: &str,
        id: &'a str,
        ids: &mut BTreeSet<&'a str>,
    ) -> Result<(), MachineFileError> {
        self.ros_name(key, id)?;
        self.name(key, id, ids.insert(id), "is used twice")
    }

    fn block(&self, key: &str, block: &BlockEntry) -> Result<(), MachineFileError> {
        for (index, sign) in block.approach_sign.into_iter().enumerate() {
            self.number(
                &format!("{key}.approach_sign[{index}]"),
                f64::from(sign),
                sign.abs() == 1,
                "must be 1 or -1",
            )?;
        }
        Ok(())
    }

    /// Refuses a block at the corner of another one: the line was copied.
    fn own_place<'b>(
        &self,
        key: &str,
        block: &BlockEntry,
        others: impl Iterator<Item = &'b BlockEntry>,
    ) -> Result<(), MachineFileError> {
        let corner_mm = Vector3::from(block.corner_mm);
        for (place, other) in others.enumerate() {
            let apart_mm = (corner_mm - Vector3::from(other.corner_mm)).norm();
            self.number(
                &format!("{key}.corner_mm less blocks[{place}].corner_mm"),
                apart_mm,
                apart_mm >= SAME_CORNER_MM,
                "must be at least 1 mm: two blocks stand at two places",
            )?;
        }
        Ok(())
    }

    fn artefact(&self, key: &str, artefact: &ArtefactEntry) -> Result<(), MachineFileError> {
        let ArtefactEntry::Plane { normal, .. } = artefact else {
            return Ok(());
        };
        let norm = Vector3::from(*normal).norm();
        let rule = "must have a length above 1e-9";
        self.number(&format!("{key}.normal"), norm, norm > 1e-9, rule)
    }

    fn sensors(&self, file: &MachineFile) -> Result<(), MachineFileError> {
        let mut ids = BTreeSet::new();
        for (index, sensor) in file.temperature_sensors.iter().enumerate() {
            let key = format!("temperature_sensors[{index}]");
            self.new_id(&format!("{key}.id"), &sensor.id, &mut ids)?;
        }
        Ok(())
    }

    fn effects(&self, file: &MachineFile) -> Result<(), MachineFileError> {
        for (index, effect) in file.effects.iter().enumerate() {
            self.ros_name(&format!("effects[{index}].kind"), &effect.kind)?;
            let mut kinds = effect_ranges::RANGES.iter();
            let kind = kinds.find(|(kind, _)| *kind == effect.kind);
            let ranges = kind.map_or(&[][..], |(_, rows)| *rows);
            for (name, value) in &effect.parameters {
                let key = format!("effects[{index}].{name}");
                self.number(&key, *value, value.is_finite(), FINITE)?;
                if ranges.iter().any(|(known, ..)| known == name) {
                    leaves::check_number(ranges, &key, *value)
                        .map_err(|source| self.bound(source))?;
                }
            }
        }
        Ok(())
    }
}
