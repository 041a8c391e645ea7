//! The rows of an identification, one pair for each point, in units of the span.
//!
//! # Model
//!
//! ```text
//!   y = T(−θ₀) reading − p − o₀: turn of the plate and offset of the zero taken out                  (1)
//!   y = Σ_c S_c(p, t) Σ_k c_k b_k(q_c) + nuisances of `unknown`                                     (2)
//!   column k of component c is divided by  a_c max|b_k|:  the unknown is then mm at the edge        (3)
//! ```
//!
//! S is what one unit of a component does at the head, from `machine::volumetric`; a = 1 for shifts and the
//! greatest distance of the head from the machine's origin for turns. θ₀ and o₀ come from the readings
//! themselves, set-up by set-up and zero by zero: what is left of the turn is small enough for (2), and the
//! minimum-norm solution shares out micrometres and not the millimetres of an arbitrary zero.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | p, t | position of the axes, tool offset | mm |
//! | S | `sensitivity` | mm/mm, mm/rad |

use std::collections::BTreeMap;

use machine::Kinematics;
use machine::volumetric::sensitivity;
use metrology::{Axis, PerAxis};

use crate::basis::ModelComponent;
use crate::recording::{GridPoint, Recording, in_plane};
use crate::unknown::{Unknown, Unknowns};

/// What the rows are made of.
#[derive(Clone, Debug)]
pub struct Equations<'a> {
    kinematics: &'a Kinematics,
    components: &'a [ModelComponent],
    pub(crate) recordings: &'a [Recording],
    radial_only: bool,
    /// Where each unknown stands.
    pub unknowns: Unknowns,
    /// Unknown in its own unit per mm at the edge: what (3) divides by, inverted.
    pub scale: Vec<f64>,
    /// Least and greatest recorded position per axis.
    pub spans: PerAxis<(f64, f64)>,
    /// θ₀ per set-up, rad.
    pub turns_rad: BTreeMap<u32, f64>,
    /// Offset per zero that is taken out, mm.
    pub offsets_mm: BTreeMap<u32, [f64; 2]>,
    /// Middle of each set-up's field, mm, about which its plate turns.
    middles_mm: BTreeMap<u32, [f64; 2]>,
}

/// Equations of one point: along u and v, or along the radius alone.
#[derive(Clone, Debug, Default)]
pub struct PointRows {
    rows: [Vec<f64>; 2],
    y_mm: [f64; 2],
    u_mm: [f64; 2],
    n: usize,
    values: Vec<f64>,
}

impl PointRows {
    /// Row, right-hand side and standard uncertainty of each equation, mm.
    pub fn iter(&self) -> impl Iterator<Item = (&[f64], f64, f64)> {
        (0..self.n).map(|k| (self.rows[k].as_slice(), self.y_mm[k], self.u_mm[k]))
    }
}

impl<'a> Equations<'a> {
    /// Lays out the unknowns and their scales.
    #[must_use]
    pub fn new(
        kinematics: &'a Kinematics,
        components: &'a [ModelComponent],
        recordings: &'a [Recording],
        unknowns: Unknowns,
        radial_only: bool,
    ) -> Self {
        let spans = spans(recordings);
        let mut equations = Self {
            kinematics,
            components,
            recordings,
            radial_only,
            scale: scales(components, recordings, &unknowns, &spans),
            unknowns,
            spans,
            turns_rad: BTreeMap::new(),
            offsets_mm: BTreeMap::new(),
            middles_mm: BTreeMap::new(),
        };
        equations.find_turns();
        equations.find_offsets();
        equations
    }

    /// Fills `out` with the equations of one point.
    pub fn fill(&self, recording_idx: usize, point: &GridPoint, out: &mut PointRows) {
        let recording = &self.recordings[recording_idx];
        let place = &recording.place;
        let p = in_plane(place.plane, &point.positions.xyz());
        let reading = self.turned_back(place.fixture.setup_id, point.reading_mm);
        out.n = 2;
        let zero = self
            .offsets_mm
            .get(&place.fixture.zero_id)
            .copied()
            .unwrap_or_default();
        out.y_mm = [reading[0] - p[0] - zero[0], reading[1] - p[1] - zero[1]];
        out.u_mm = point.standard_uncertainty_mm;
        for row in &mut out.rows {
            row.clear();
            row.resize(self.unknowns.len(), 0.0);
        }
        self.fill_components(recording, point, out);
        self.fill_nuisances(recording, point, p, out);
        if self.radial_only {
            let centre = in_plane(place.plane, &place.centre_mm);
            fold_to_radius([p[0] - centre[0], p[1] - centre[1]], out);
            if let Some(first) = self.unknowns.radius_at {
                out.rows[0][first + recording_idx] = 1.0;
            }
        }
        for row in &mut out.rows[..out.n] {
            for (entry, scale) in row.iter_mut().zip(&self.scale) {
                *entry *= scale;
            }
        }
    }

    /// What a change of one point's reading changes in the right-hand sides of its equations, mm.
    pub(crate) fn right_side_of(
        &self,
        recording_idx: usize,
        point_idx: usize,
        change_mm: [f64; 2],
    ) -> [f64; 2] {
        let recording = &self.recordings[recording_idx];
        let place = &recording.place;
        let turned_mm = self.turned_back(place.fixture.setup_id, change_mm);
        if !self.radial_only {
            return turned_mm;
        }
        let p = in_plane(place.plane, &recording.points[point_idx].positions.xyz());
        let centre = in_plane(place.plane, &place.centre_mm);
        let n = direction([p[0] - centre[0], p[1] - centre[1]]).unwrap_or_default();
        [n[0] * turned_mm[0] + n[1] * turned_mm[1], 0.0]
    }

    fn fill_components(&self, recording: &Recording, point: &GridPoint, out: &mut PointRows) {
        let place = &recording.place;
        let mut column = 0;
        for model in self.components {
            let lever = sensitivity(
                self.kinematics,
                &point.positions,
                &place.tool_offset_mm,
                model.component,
            );
            let [u, v] = in_plane(place.plane, &lever);
            out.values.clear();
            model
                .basis
                .values(point.positions[model.component.of], &mut out.values);
            for value in &out.values {
                out.rows[0][column] = u * value;
                out.rows[1][column] = v * value;
                column += 1;
            }
        }
    }

    fn fill_nuisances(
        &self,
        recording: &Recording,
        point: &GridPoint,
        p: [f64; 2],
        out: &mut PointRows,
    ) {
        let place = &recording.place;
        let [row_u, row_v] = &mut out.rows;
        if let Some(&at) = self.unknowns.zero_at.get(&place.fixture.zero_id) {
            row_u[at] = 1.0;
            row_v[at + 1] = 1.0;
        }
        if let Some(&at) = self.unknowns.setup_at.get(&place.fixture.setup_id) {
            let middle = self
                .middles_mm
                .get(&place.fixture.setup_id)
                .copied()
                .unwrap_or_default();
            row_u[at] = -(p[1] - middle[1]);
            row_v[at] = p[0] - middle[0];
        }
        for (axis, at) in Axis::LINEAR.into_iter().zip(self.unknowns.lost_motion_at) {
            let Some(at) = at else { continue };
            let mut lag = nalgebra::Vector3::zeros();
            lag[axis.index()] = -0.5 * point.sense[axis.index()];
            let [u, v] = in_plane(place.plane, &lag);
            row_u[at] = u;
            row_v[at] = v;
        }
        if let Some(at) = self.unknowns.stamp_offset_at {
            let [u, v] = in_plane(place.plane, &point.velocity_mm_s);
            row_u[at] = u;
            row_v[at] = v;
        }
    }

    fn turned_back(&self, setup_id: u32, reading_mm: [f64; 2]) -> [f64; 2] {
        let turn_rad = self.turns_rad.get(&setup_id).copied().unwrap_or(0.0);
        let (sin, cos) = turn_rad.sin_cos();
        let [u, v] = reading_mm;
        [u * cos + v * sin, v * cos - u * sin]
    }

    /// θ₀: the turn that takes positions into readings best, zero by zero about their means.
    fn find_turns(&mut self) {
        let mut sums: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
        let mut middles: BTreeMap<u32, ([f64; 2], f64)> = BTreeMap::new();
        for recording in self.recordings {
            let place = &recording.place;
            let n = recording.points.len().max(1) as f64;
            let at = |point: &GridPoint| in_plane(place.plane, &point.positions.xyz());
            let mut mean = [0.0; 4];
            for point in &recording.points {
                let ([pu, pv], [ru, rv]) = (at(point), point.reading_mm);
                for (mean, value) in mean.iter_mut().zip([pu, pv, ru, rv]) {
                    *mean += value / n;
                }
            }
            let (dot, cross) = sums.entry(place.fixture.setup_id).or_default();
            for point in &recording.points {
                let ([pu, pv], [ru, rv]) = (at(point), point.reading_mm);
                let (pu, pv, ru, rv) = (pu - mean[0], pv - mean[1], ru - mean[2], rv - mean[3]);
                *dot += pu * ru + pv * rv;
                *cross += pu * rv - pv * ru;
            }
            let (middle, weight) = middles.entry(place.fixture.setup_id).or_default();
            *weight += n;
            middle[0] += n * mean[0];
            middle[1] += n * mean[1];
        }
        let middle = |([u, v], weight): ([f64; 2], f64)| [u / weight, v / weight];
        self.middles_mm = middles
            .into_iter()
            .map(|(id, sum)| (id, middle(sum)))
            .collect();
        if self.unknowns.setup_at.is_empty() {
            return;
        }
        let turn = |(dot, cross): (f64, f64)| cross.atan2(dot);
        self.turns_rad = sums.into_iter().map(|(id, sum)| (id, turn(sum))).collect();
    }

    /// o₀: mean of readings less positions, zero by zero.
    fn find_offsets(&mut self) {
        let mut sums: BTreeMap<u32, [f64; 3]> = BTreeMap::new();
        for recording in self.recordings {
            let place = &recording.place;
            if !self.unknowns.zero_at.contains_key(&place.fixture.zero_id) {
                continue;
            }
            let [n, u, v] = sums.entry(place.fixture.zero_id).or_default();
            for point in &recording.points {
                let at = in_plane(place.plane, &point.positions.xyz());
                let reading = self.turned_back(place.fixture.setup_id, point.reading_mm);
                *n += 1.0;
                *u += reading[0] - at[0];
                *v += reading[1] - at[1];
            }
        }
        let mean = |[n, u, v]: [f64; 3]| if n > 0.0 { [u / n, v / n] } else { [0.0; 2] };
        self.offsets_mm = sums.into_iter().map(|(id, sum)| (id, mean(sum))).collect();
    }
}

/// Of unit length; none at the centre.
fn direction(arm: [f64; 2]) -> Option<[f64; 2]> {
    let length = arm[0].hypot(arm[1]);
    (length > 0.0).then(|| [arm[0] / length, arm[1] / length])
}

/// Turns two equations into the one along `arm`.
fn fold_to_radius(arm: [f64; 2], out: &mut PointRows) {
    let Some(n) = direction(arm) else {
        out.n = 0;
        return;
    };
    let [row_u, row_v] = &mut out.rows;
    for (u, v) in row_u.iter_mut().zip(row_v) {
        *u = n[0] * *u + n[1] * *v;
    }
    out.y_mm[0] = n[0] * out.y_mm[0] + n[1] * out.y_mm[1];
    out.u_mm[0] = (n[0] * out.u_mm[0]).hypot(n[1] * out.u_mm[1]);
    out.n = 1;
}

pub(crate) fn spans(recordings: &[Recording]) -> PerAxis<(f64, f64)> {
    let points = || recordings.iter().flat_map(|recording| &recording.points);
    PerAxis::from_fn(|axis| {
        let of = points().map(|point| point.positions[axis]);
        of.fold(None, |span: Option<(f64, f64)>, q| {
            let (least, greatest) = span.unwrap_or((q, q));
            Some((least.min(q), greatest.max(q)))
        })
        .unwrap_or((0.0, 0.0))
    })
}

/// (3).
fn scales(
    components: &[ModelComponent],
    recordings: &[Recording],
    unknowns: &Unknowns,
    spans: &PerAxis<(f64, f64)>,
) -> Vec<f64> {
    let points = || {
        recordings
            .iter()
            .flat_map(|r| r.points.iter().map(move |p| (r, p)))
    };
    let arm_mm = points()
        .map(|(r, p)| (p.positions.xyz() + r.place.tool_offset_mm).norm())
        .fold(1.0, f64::max);
    let speed_mm_s = points()
        .map(|(_, p)| p.velocity_mm_s.norm())
        .fold(1.0, f64::max);
    let coefficients = components.iter().flat_map(|model| {
        let arm = if model.component.is_angular() {
            arm_mm
        } else {
            1.0
        };
        let span = spans[model.component.of];
        (0..model.basis.len()).map(move |idx| 1.0 / (arm * model.basis.reach(idx, span)))
    });
    let nuisances = unknowns.all.iter().skip(unknowns.n_coefficients);
    let nuisances = nuisances.map(|unknown| match unknown {
        Unknown::PlateRotation { .. } => 1.0 / arm_mm,
        Unknown::StampOffset => 1.0 / speed_mm_s,
        _ => 1.0,
    });
    coefficients.chain(nuisances).collect()
}
