//! The recordings of one plane, made ready: angles unwrapped, positions, and how long ago each axis reversed.
//!
//! ```text
//!   axis 1 reverses at θ = 0 (positive end) and π, axis 2 at π/2 and 3π/2        (1)
//!   s_a = (σ θ − σ θ_a⁺) mod π     arc since the last reversal                    (2)
//! ```

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::recording::{CircularPlane, CircularRecording, ReferenceLength};
use metrology::Axis;

/// A sample with all that regressors need.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// cos θ and sin θ: what each axis shows of its error.
    pub direction: [f64; 2],
    /// Unwrapped angle, rad.
    pub angle_rad: f64,
    /// Position on each axis, mm.
    pub position_mm: [f64; 2],
    /// Position from the centre of the first recording, mm.
    pub offset_mm: [f64; 2],
    /// Arc since the last reversal of each axis, rad.
    pub arc_rad: [f64; 2],
    /// +1 where that reversal was at the positive end of the axis, else −1.
    pub end: [f64; 2],
    /// Time from the middle of the recording, s.
    pub time_s: f64,
    /// Measured radial deviation, mm.
    pub observed_mm: f64,
}

/// A recording made ready.
#[derive(Clone, Debug)]
pub(super) struct Trace {
    /// Its place in the caller's list.
    pub recording: usize,
    pub circle: Circle,
    /// +1 counter-clockwise.
    pub sense: f64,
    pub radius_mm: f64,
    pub feed_mm_s: f64,
    /// Which centre is shared: recordings of one set-up and zero.
    pub zero: usize,
    /// Which free reference length is shared.
    pub reference: Option<usize>,
    /// Which calibrated one, where it has an uncertainty.
    pub certificate: Option<usize>,
    /// Which feed and radius.
    pub condition: usize,
    /// Row of its first sample in the stacked design.
    pub first_row: usize,
    /// Typical angle between samples, rad: the median.
    pub spacing_rad: f64,
    pub points: Vec<Point>,
    /// What each point stands for, where it stands for several samples.
    pub blocks: Vec<Block>,
}

/// Several samples in a row, by two places that have their mean and their spread.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    pub nodes: [Point; 2],
    /// √ of the number of samples: what their mean counts for.
    pub root: f64,
}

/// All recordings of a plane.
#[derive(Clone, Debug)]
pub(super) struct Scene {
    pub axes: [Axis; 2],
    pub traces: Vec<Trace>,
    pub n_zeros: usize,
    /// Free reference lengths.
    pub n_references: usize,
    /// Standard uncertainty of each calibrated reference length, mm.
    pub certificates_mm: Vec<f64>,
    /// Feed and radius of each condition.
    pub conditions: Vec<(f64, f64)>,
    pub largest_radius_mm: f64,
    pub n_rows: usize,
    /// Samples behind the rows.
    pub n_samples: usize,
}

/// Place of `item` in `seen`, where it is put if it is new.
fn place<T: PartialEq>(seen: &mut Vec<T>, item: T) -> usize {
    seen.iter()
        .position(|other| *other == item)
        .unwrap_or_else(|| {
            seen.push(item);
            seen.len() - 1
        })
}

impl Scene {
    pub fn new(plane: CircularPlane, recordings: &[(usize, &CircularRecording)]) -> Self {
        let origin_mm = recordings.first().map_or([0.0; 2], |(_, r)| r.centre_mm);
        let (mut zeros, mut conditions, mut n_rows) = (Vec::new(), Vec::new(), 0);
        let (mut free, mut calibrated, mut certificates_mm) = (Vec::new(), Vec::new(), Vec::new());
        let mut traces = Vec::new();
        for (index, recording) in recordings {
            let key = (recording.setup_id, recording.zero_id);
            let own = (key, recording.radius_mm.to_bits());
            let (mut reference, mut certificate) = (None, None);
            match recording.reference {
                ReferenceLength::Free => reference = Some(place(&mut free, own)),
                ReferenceLength::Calibrated {
                    standard_uncertainty_mm: u,
                } if u > 0.0 => {
                    let at = place(&mut calibrated, (own, u.to_bits()));
                    certificates_mm.resize(calibrated.len(), u);
                    certificate = Some(at);
                }
                ReferenceLength::Calibrated { .. } => {}
            }
            let condition = (recording.feed_mm_s, recording.radius_mm);
            let circle = Circle {
                sense: recording.sense.sign(),
                radius_mm: recording.radius_mm,
                centre_mm: recording.centre_mm,
                origin_mm,
            };
            let points = points(recording, &circle);
            traces.push(Trace {
                recording: *index,
                circle,
                sense: recording.sense.sign(),
                radius_mm: recording.radius_mm,
                feed_mm_s: recording.feed_mm_s,
                zero: place(&mut zeros, key),
                reference,
                certificate,
                condition: place(&mut conditions, condition),
                first_row: n_rows,
                spacing_rad: spacing_rad(&points),
                points,
                blocks: Vec::new(),
            });
            n_rows += recording.samples.len();
        }
        let largest_radius_mm = traces.iter().map(|t| t.radius_mm).fold(0.0, f64::max);
        Self {
            axes: plane.axes(),
            traces,
            n_zeros: zeros.len(),
            n_references: free.len(),
            certificates_mm,
            conditions,
            largest_radius_mm,
            n_rows,
            n_samples: n_rows,
        }
    }

    /// Every trace and point, in the order of the rows of the stacked design.
    pub fn rows(&self) -> impl Iterator<Item = (&Trace, &Point)> {
        self.traces
            .iter()
            .flat_map(|trace| trace.points.iter().map(move |point| (trace, point)))
    }

    /// Name such as `XY`.
    pub fn name(&self) -> String {
        format!("{}{}", self.axes[0], self.axes[1])
    }
}

impl Trace {
    /// Rows of its samples in the stacked design.
    pub fn rows(&self) -> std::ops::Range<usize> {
        self.first_row..self.first_row + self.points.len()
    }

    /// Angular speed, rad/s.
    pub fn speed_rad_s(&self) -> f64 {
        self.feed_mm_s / self.radius_mm
    }

    /// √ of the number of samples behind a point.
    pub fn root(&self, place: usize) -> f64 {
        self.blocks.get(place).map_or(1.0, |block| block.root)
    }

    /// Mean of a quantity over the samples behind a point, times [`Self::root`].
    pub fn mean(&self, place: usize, of: impl Fn(&Point) -> f64) -> f64 {
        match self.blocks.get(place) {
            Some(block) => 0.5 * block.root * block.nodes.iter().map(of).sum::<f64>(),
            None => of(&self.points[place]),
        }
    }
}

/// Typical angle between points, rad: the median.
pub(super) fn spacing_rad(points: &[Point]) -> f64 {
    let gaps = points.windows(2).map(|pair| match pair {
        [a, b] => (b.angle_rad - a.angle_rad).abs(),
        _ => 0.0,
    });
    let mut gaps: Vec<f64> = gaps.filter(|gap| *gap > 0.0).collect();
    let middle = gaps.len() / 2;
    if gaps.is_empty() {
        return TAU;
    }
    *gaps.select_nth_unstable_by(middle, f64::total_cmp).1
}

impl Point {
    /// At an angle of a circle.
    pub fn new(circle: &Circle, angle_rad: f64, time_s: f64, observed_mm: f64) -> Self {
        let (sin, cos) = angle_rad.sin_cos();
        let direction = [cos, sin];
        let position_mm = [0, 1].map(|a| circle.centre_mm[a] + circle.radius_mm * direction[a]);
        // (1): the positive ends are at 0 and π/2, half a turn of σθ after the negative ones.
        let since_positive =
            [0.0, FRAC_PI_2].map(|end| (circle.sense * (angle_rad - end)).rem_euclid(TAU));
        Self {
            direction,
            angle_rad,
            position_mm,
            offset_mm: [0, 1].map(|a| position_mm[a] - circle.origin_mm[a]),
            arc_rad: since_positive.map(|arc| arc % PI), // (2)
            end: since_positive.map(|arc| if arc < PI { 1.0 } else { -1.0 }),
            time_s,
            observed_mm,
        }
    }
}

/// Where a trace runs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Circle {
    pub sense: f64,
    pub radius_mm: f64,
    pub centre_mm: [f64; 2],
    /// Centre of the first recording, mm.
    pub origin_mm: [f64; 2],
}

fn points(recording: &CircularRecording, circle: &Circle) -> Vec<Point> {
    let time = |sample: Option<&super::CircularSample>| sample.map_or(0.0, |s| s.time_s);
    let middle_s = 0.5 * (time(recording.samples.first()) + time(recording.samples.last()));
    let angles = recording.unwrapped_rad();
    let samples = recording.samples.iter().zip(angles);
    samples
        .map(|(sample, angle_rad)| {
            let time_s = sample.time_s - middle_s;
            Point::new(circle, angle_rad, time_s, sample.radial_deviation_mm)
        })
        .collect()
}
