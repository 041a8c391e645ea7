//! What must hold in a machine file beyond its syntax.

use std::collections::BTreeSet;

use metrology::Axis;

use super::{
    ArtefactEntry, AxisEntry, BlockEntry, GuideFrictionEntry, LinearAxisEntry, MachineFile,
    PositionFeedback, RotaryAxisEntry, VelocityLoopEntry, reference,
};
use crate::chain::Chain;
use crate::cycle::artefact_id;
use crate::error::MachineFileError;

const ABOVE_ZERO: &str = "must be a finite number above 0";
const FINITE: &str = "must be a finite number";
const NOT_NEGATIVE: &str = "must be a finite number, 0 or above";
const SHARE: &str = "must be from 0 to 1";
const ROS_NAME: &str =
    "must begin with a letter and consist of letters, digits and single underscores";

impl MachineFile {
    /// Checks every value; `source_name` stands in the errors.
    ///
    /// # Errors
    /// The first rule that is broken, with its key and value.
    pub fn check(&self, source_name: &str) -> Result<(), MachineFileError> {
        let check = Check { source_name };
        check.ros_name("name", &self.name)?;
        for (axis, entry) in &self.axes {
            let key = format!("axes.{axis}");
            match entry {
                AxisEntry::Linear(entry) => check.linear(&key, entry)?,
                AxisEntry::Rotary(entry) => check.rotary(&key, entry)?,
            }
            check.kind(*axis, entry)?;
        }
        check.chain(self)?;
        check.origins(self)?;
        check.positive("control.servo_period_ms", self.control.servo_period_ms)?;
        check.positive(
            "control.pulse_equivalent_um",
            self.control.pulse_equivalent_um,
        )?;
        check.probe(self)?;
        check.features(self)?;
        check.table(self)?;
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
        if holds && value.is_finite() {
            return Ok(());
        }
        Err(MachineFileError::Number {
            source_name: self.source_name.to_owned(),
            key: key.to_owned(),
            value,
            rule,
        })
    }

    pub(super) fn positive(&self, key: &str, value: f64) -> Result<(), MachineFileError> {
        self.number(key, value, value > 0.0, ABOVE_ZERO)
    }

    pub(super) fn finite(&self, key: &str, values: &[f64]) -> Result<(), MachineFileError> {
        for (index, &value) in values.iter().enumerate() {
            self.number(&format!("{key}[{index}]"), value, true, FINITE)?;
        }
        Ok(())
    }

    fn travel(&self, key: &str, [least, greatest]: [f64; 2]) -> Result<(), MachineFileError> {
        self.finite(key, &[least, greatest])?;
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

    fn name(
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
        let legal = name.starts_with(|c: char| c.is_ascii_alphabetic())
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
            && !name.contains("__");
        self.name(key, name, legal, ROS_NAME)
    }

    fn loop_of(&self, key: &str, gain_per_s: f64, share: f64) -> Result<(), MachineFileError> {
        self.positive(&format!("{key}.position_gain_per_s"), gain_per_s)?;
        let holds = (0.0..=1.0).contains(&share);
        self.number(&format!("{key}.velocity_feedforward"), share, holds, SHARE)
    }

    fn velocity_loop(
        &self,
        key: &str,
        entry: Option<&VelocityLoopEntry>,
    ) -> Result<(), MachineFileError> {
        let Some(entry) = entry else { return Ok(()) };
        let at = |field: &str| format!("{key}.velocity_loop.{field}");
        self.positive(&at("frequency_hz"), entry.frequency_hz)?;
        self.positive(&at("damping"), entry.damping)?;
        let holds = entry.filter_ms >= 0.0 && entry.filter_ms.is_finite();
        self.number(&at("filter_ms"), entry.filter_ms, holds, NOT_NEGATIVE)
    }

    fn linear(&self, key: &str, entry: &LinearAxisEntry) -> Result<(), MachineFileError> {
        self.travel(&format!("{key}.travel_mm"), entry.travel_mm)?;
        let fields = [
            ("feed_limit_mm_min", entry.feed_limit_mm_min),
            ("acceleration_limit_mm_s2", entry.acceleration_limit_mm_s2),
            ("lead_mm", entry.lead_mm),
            ("encoder_resolution_um", entry.encoder_resolution_um),
        ];
        for (field, value) in fields {
            self.positive(&format!("{key}.{field}"), value)?;
        }
        if let Some(value) = entry.scale_resolution_um {
            self.positive(&format!("{key}.scale_resolution_um"), value)?;
        }
        self.guide_friction(key, entry.guide_friction.as_ref())?;
        self.velocity_loop(key, entry.velocity_loop.as_ref())?;
        self.loop_of(key, entry.position_gain_per_s, entry.velocity_feedforward)
    }

    fn guide_friction(
        &self,
        key: &str,
        entry: Option<&GuideFrictionEntry>,
    ) -> Result<(), MachineFileError> {
        let Some(entry) = entry else { return Ok(()) };
        let at = |field: &str| format!("{key}.guide_friction.{field}");
        self.positive(&at("coulomb_mm_s2"), entry.coulomb_mm_s2)?;
        let viscous = entry.viscous_per_s;
        let holds = viscous >= 0.0 && viscous.is_finite();
        self.number(&at("viscous_per_s"), viscous, holds, NOT_NEGATIVE)
    }

    fn rotary(&self, key: &str, entry: &RotaryAxisEntry) -> Result<(), MachineFileError> {
        self.travel(&format!("{key}.travel_deg"), entry.travel_deg)?;
        let fields = [
            ("feed_limit_deg_min", entry.feed_limit_deg_min),
            ("acceleration_limit_deg_s2", entry.acceleration_limit_deg_s2),
            ("encoder_resolution_arcsec", entry.encoder_resolution_arcsec),
        ];
        for (field, value) in fields {
            self.positive(&format!("{key}.{field}"), value)?;
        }
        self.velocity_loop(key, entry.velocity_loop.as_ref())?;
        self.loop_of(key, entry.position_gain_per_s, entry.velocity_feedforward)
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
                Ok(())
            }
            (false, AxisEntry::Rotary(_)) => Ok(()),
            (true, AxisEntry::Rotary(_)) => Err(self.axis(axis, "X Y Z are linear axes")),
            (false, AxisEntry::Linear(_)) => Err(self.axis(axis, "A B C are rotary axes")),
        }
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
                (true, Some(origin)) => self.finite(&format!("rotary.origin_mm.{axis}"), origin)?,
                (false, None) => {}
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
        for (name, stylus) in &probe.styli {
            let key = format!("probe.styli.{name}");
            self.ros_name(&key, name)?;
            self.positive(&format!("{key}.radius_mm"), stylus.radius_mm)?;
            self.positive(&format!("{key}.length_mm"), stylus.length_mm)?;
        }
        let known = probe.styli.contains_key(&probe.mounted);
        let rule = "must be one of probe.styli";
        self.name("probe.mounted", &probe.mounted, known, rule)?;
        self.positive("probe.standoff_mm", probe.standoff_mm)?;
        self.positive("probe.overtravel_mm", probe.overtravel_mm)?;
        self.positive("probe.feed_mm_min", probe.feed_mm_min)?;
        self.number(
            "probe.repeatability_um",
            probe.repeatability_um,
            probe.repeatability_um >= 0.0,
            NOT_NEGATIVE,
        )?;
        match probe.latency_ms {
            Some(value) => self.number("probe.latency_ms", value, value >= 0.0, NOT_NEGATIVE),
            None => Ok(()),
        }
    }

    fn features(&self, file: &MachineFile) -> Result<(), MachineFileError> {
        let mut ids = BTreeSet::new();
        for (index, block) in file.blocks.iter().enumerate() {
            let key = format!("blocks[{index}]");
            self.block(&key, block)?;
            self.new_id(&format!("{key}.id"), &block.id, &mut ids)?;
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
        self.finite(&format!("{key}.corner_mm"), &block.corner_mm)?;
        for (index, sign) in block.approach_sign.into_iter().enumerate() {
            self.number(
                &format!("{key}.approach_sign[{index}]"),
                f64::from(sign),
                sign.abs() == 1,
                "must be 1 or -1",
            )?;
        }
        self.positive(&format!("{key}.inset_mm"), block.inset_mm)
    }

    fn artefact(&self, key: &str, artefact: &ArtefactEntry) -> Result<(), MachineFileError> {
        match artefact {
            ArtefactEntry::Sphere {
                centre_mm,
                radius_mm,
                ..
            }
            | ArtefactEntry::Bore {
                centre_mm,
                radius_mm,
                ..
            }
            | ArtefactEntry::Boss {
                centre_mm,
                radius_mm,
                ..
            } => {
                self.finite(&format!("{key}.centre_mm"), centre_mm)?;
                self.positive(&format!("{key}.radius_mm"), *radius_mm)
            }
            ArtefactEntry::Plane {
                point_mm,
                normal,
                half_side_mm,
                ..
            } => {
                self.finite(&format!("{key}.point_mm"), point_mm)?;
                self.finite(&format!("{key}.normal"), normal)?;
                let norm = nalgebra::Vector3::from(*normal).norm();
                let rule = "must have a length above 1e-9";
                self.number(&format!("{key}.normal"), norm, norm > 1e-9, rule)?;
                self.positive(&format!("{key}.half_side_mm"), *half_side_mm)
            }
        }
    }

    fn table(&self, file: &MachineFile) -> Result<(), MachineFileError> {
        let Some(table) = &file.table else {
            return Ok(());
        };
        self.finite("table.top_z_mm", &[table.top_z_mm])?;
        self.positive("table.radius_mm", table.radius_mm)?;
        self.positive("table.nose_radius_mm", table.nose_radius_mm)
    }

    fn sensors(&self, file: &MachineFile) -> Result<(), MachineFileError> {
        let mut ids = BTreeSet::new();
        for (index, sensor) in file.temperature_sensors.iter().enumerate() {
            let key = format!("temperature_sensors[{index}]");
            self.new_id(&format!("{key}.id"), &sensor.id, &mut ids)?;
            self.positive(&format!("{key}.period_s"), sensor.period_s)?;
        }
        Ok(())
    }

    fn effects(&self, file: &MachineFile) -> Result<(), MachineFileError> {
        for (index, effect) in file.effects.iter().enumerate() {
            self.ros_name(&format!("effects[{index}].kind"), &effect.kind)?;
            for (name, value) in &effect.parameters {
                self.number(&format!("effects[{index}].{name}"), *value, true, FINITE)?;
            }
        }
        Ok(())
    }
}
