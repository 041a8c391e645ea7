//! A ballbar in the place of the plate: (1) of [`super`].

use metrology::Axis;
use metrology::sample::{AxisState, GridSample, LengthSample, TestKind, TestPlane, TestSegment};
use nalgebra::Vector3;
use trials::Sample;

/// What a ballbar reads where the drawn machine has a plate.
#[derive(Default)]
pub(super) struct Bar {
    circle: Option<TestSegment>,
    commanded_mm: Vector3<f64>,
    /// Count of the plate, and the place of its zero along u and v, mm.
    zero: Option<(u32, [f64; 2])>,
}

impl Bar {
    /// The sample as it is recorded; none where no ballbar would read it.
    pub(super) fn read(&mut self, sample: Sample) -> Option<Sample> {
        match sample {
            Sample::Segment(segment) => {
                let is_circle = segment.begin && segment.kind == TestKind::Circle;
                self.circle = is_circle.then(|| segment.clone());
                Some(Sample::Segment(segment))
            }
            Sample::State(state) => {
                self.stand(&state);
                Some(Sample::State(state))
            }
            Sample::Grid(grid) => self.length(&grid).map(Sample::Length),
            other => Some(other),
        }
    }

    fn stand(&mut self, state: &AxisState) {
        self.commanded_mm = state.commanded.xyz();
    }

    /// (1); none between circles.
    fn length(&mut self, grid: &GridSample) -> Option<LengthSample> {
        let [u, v] = axes(grid.plane)?;
        let here_mm = [u, v].map(|axis| self.commanded_mm[axis.index()]);
        let read_mm = [grid.u_mm, grid.v_mm];
        if self.zero.is_none_or(|(id, _)| id != grid.zero_id) {
            // Where the plate was set to zero, but for micrometres that move the centre of the bar alone.
            self.zero = Some((
                grid.zero_id,
                [here_mm[0] - read_mm[0], here_mm[1] - read_mm[1]],
            ));
        }
        let (_, zero_mm) = self.zero?;
        let circle = self.circle.as_ref()?;
        let centre_mm = [u, v].map(|axis| circle.centre_mm[axis.index()]);
        let of = |k: usize| read_mm[k] + zero_mm[k] - centre_mm[k];
        Some(LengthSample {
            at: grid.at,
            axis: u,
            displacement_mm: of(0).hypot(of(1)),
            zero_id: grid.zero_id,
        })
    }
}

/// First and second axis of a plane.
const fn axes(plane: TestPlane) -> Option<[Axis; 2]> {
    match plane {
        TestPlane::Xy => Some([Axis::X, Axis::Y]),
        TestPlane::Yz => Some([Axis::Y, Axis::Z]),
        TestPlane::Zx => Some([Axis::Z, Axis::X]),
        TestPlane::None => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::{AxisSet, PerAxis, Stamp};

    fn state(x_mm: f64, y_mm: f64) -> Sample {
        let mut commanded = PerAxis::default();
        commanded[Axis::X] = x_mm;
        commanded[Axis::Y] = y_mm;
        Sample::State(AxisState {
            received_at: Stamp::from_nanos(0),
            controller_at: Stamp::from_nanos(0),
            axes: AxisSet::XYZ,
            commanded,
            motor: commanded,
            scale: PerAxis([f64::NAN; 6]),
            velocity: PerAxis::default(),
        })
    }

    fn grid(u_mm: f64, v_mm: f64) -> Sample {
        Sample::Grid(GridSample {
            at: Stamp::from_nanos(0),
            plane: TestPlane::Xy,
            u_mm,
            v_mm,
            zero_id: 3,
        })
    }

    /// About (10, 5) with a radius of 50 mm: the plate is zeroed at (0, 0), and the tool is 2 µm too far out.
    #[test]
    fn eq1_a_plate_that_reads_two_micrometres_outside_is_a_bar_that_is_two_longer() {
        let mut bar = Bar::default();
        let circle = TestSegment {
            centre_mm: Vector3::new(10.0, 5.0, 0.0),
            ..TestSegment::of_kind(TestKind::Circle, 1, Stamp::from_nanos(0))
        };
        assert!(bar.read(grid(0.0, 0.0)).is_none(), "no circle yet");
        assert!(bar.read(Sample::Segment(circle.clone())).is_some());
        let _ = bar.read(state(60.0, 5.0));
        for (read_mm, wanted_mm) in [
            ([60.0, 5.0], 50.0),
            ([60.002, 5.0], 50.002),
            ([10.0, 55.002], 50.002),
        ] {
            let Some(Sample::Length(length)) = bar.read(grid(read_mm[0], read_mm[1])) else {
                panic!("a length");
            };
            assert!(
                (length.displacement_mm - wanted_mm).abs() < 1e-9,
                "{length:?}"
            );
        }
        let end = TestSegment {
            begin: false,
            ..circle
        };
        let _ = bar.read(Sample::Segment(end));
        assert!(bar.read(grid(60.0, 5.0)).is_none(), "after the circle");
    }
}
