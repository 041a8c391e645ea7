//! The stylus ball among the artefacts: looked at closely only where a touch is possible.
//!
//! The distance to the nearest artefact is evaluated once and then spent by the path of the axes, as
//! a bound: no axis can bring the ball nearer than by its own path (rotary axes: path times the
//! reach of the table). Only within a margin of a surface is every period evaluated.

use machine::MachineFile;
use metrology::PerAxis;
use metrology::stamp::Span;
use nalgebra::Vector3;

use super::artefact::{Artefact, Nearness};
use super::chain::Rigid;
use super::error::{PlantError, require_positive};
use super::file::PlantFile;
use super::pretravel::Seat;
use super::structure::{Standing, Structure};
use super::touch_probe::TouchProbe;

/// Distance within which every period is evaluated, mm; well above what heat and play can move.
const MARGIN_MM: f64 = 1.0;

/// Ball, artefacts and probe.
#[derive(Clone, Debug)]
pub(super) struct Contact {
    artefacts: Vec<Artefact>,
    seat: Seat,
    pub(super) probe: TouchProbe,
    ball_radius_mm: f64,
    /// Path that the axes may still go before a look is needed, mm.
    clear_path_mm: f64,
    /// Path of the ball for one radian of a rotary axis, mm.
    reach_mm: f64,
    depth_mm: Option<f64>,
}

impl Contact {
    pub(super) fn new(machine: &MachineFile, truth: &PlantFile) -> Result<Self, PlantError> {
        let stylus = machine
            .probe
            .styli
            .get(&machine.probe.mounted)
            .ok_or_else(|| PlantError::NameUnknown {
                place: "probe.mounted",
                name: machine.probe.mounted.clone(),
            })?;
        let entry = &truth.touch_probe;
        let ball_radius_mm = stylus.radius_mm + entry.ball_radius_deviation_um / 1e3;
        require_positive("probe.styli.radius_mm", ball_radius_mm)?;
        let farthest = PerAxis::from_fn(|axis| {
            machine.linear(axis).map_or(0.0, |linear| {
                linear.travel_mm[0].abs().max(linear.travel_mm[1].abs())
            })
        });
        let origin_mm = machine
            .rotary
            .iter()
            .flat_map(|rotary| rotary.origin_mm.values());
        let offset_mm = origin_mm
            .map(|origin| Vector3::from(*origin).norm())
            .fold(0.0, f64::max);
        Ok(Self {
            artefacts: Artefact::all(machine, &truth.artefacts, &truth.faults, truth.seed)?,
            seat: Seat::new(entry)?,
            probe: TouchProbe::new(entry, &truth.faults, truth.seed)?,
            ball_radius_mm,
            clear_path_mm: 0.0,
            reach_mm: farthest.xyz().norm() + offset_mm,
            depth_mm: None,
        })
    }

    /// Books the path of linear (mm) and rotary axes (rad); gives whether a look is needed.
    #[inline]
    pub(super) fn travel(&mut self, linear_mm: f64, rotary_rad: f64) -> bool {
        self.clear_path_mm -= linear_mm + rotary_rad * self.reach_mm;
        self.clear_path_mm <= 0.0
    }

    /// Forgets the last distance, after the ball was put elsewhere.
    pub(super) fn forget(&mut self, now: Span) {
        self.clear_path_mm = 0.0;
        self.depth_mm = None;
        self.probe.leave(now);
    }

    /// Lets happen what happens to the artefacts up to `elapsed_s`.
    pub(super) fn age(&mut self, elapsed_s: f64) {
        for artefact in &mut self.artefacts {
            artefact.age(elapsed_s);
        }
    }

    /// The period from `start` ended with the tool at `workpiece_from_tool`.
    pub(super) fn look(
        &mut self,
        start: Span,
        period_s: f64,
        workpiece_from_tool: &Rigid,
        structure: &Structure,
    ) {
        let tip_mm = workpiece_from_tool.translation.vector;
        let Some(nearest) = self.nearest(&tip_mm, structure) else {
            self.clear_path_mm = f64::INFINITY;
            return;
        };
        let depth_mm = self.ball_radius_mm - nearest.distance_mm;
        if depth_mm < -MARGIN_MM {
            self.clear_path_mm = -depth_mm - MARGIN_MM;
            self.depth_mm = None;
            self.probe.leave(start);
            return;
        }
        self.clear_path_mm = 0.0;
        let speed_mm_s = self
            .depth_mm
            .map_or(0.0, |before| (depth_mm - before) / period_s);
        self.depth_mm = Some(depth_mm);
        let force = workpiece_from_tool.rotation.inverse() * nearest.away;
        let pretravel_mm = self.seat.pretravel_mm(&force, speed_mm_s);
        self.probe.follow(start, period_s, depth_mm, pretravel_mm);
    }

    fn nearest(&self, tip_mm: &Vector3<f64>, structure: &Structure) -> Option<Nearness> {
        self.artefacts
            .iter()
            .map(|artefact| {
                let growth_mm = structure.on_table_mm(&artefact.place_mm, Standing::Artefact);
                artefact.nearness(&(tip_mm - growth_mm))
            })
            .min_by(|a, b| a.distance_mm.total_cmp(&b.distance_mm))
    }
}
