//! Where an axis can be at some line, in machine coordinates.

/// One value, or anywhere that a touch may have ended; mm or rad.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    pub(super) least: f64,
    pub(super) greatest: f64,
}

impl Reach {
    pub(super) const fn at(value: f64) -> Self {
        Self {
            least: value,
            greatest: value,
        }
    }

    pub(super) fn known(self) -> Option<f64> {
        (self.greatest <= self.least).then_some(self.least)
    }

    pub(super) fn hull(self, other: Self) -> Self {
        Self {
            least: self.least.min(other.least),
            greatest: self.greatest.max(other.greatest),
        }
    }

    pub(super) fn by(self, way: Self) -> Self {
        Self {
            least: self.least + way.least,
            greatest: self.greatest + way.greatest,
        }
    }
}

/// What the corners of a rectangle reach under `image`.
pub(super) fn image_of_rectangle(
    first: Reach,
    second: Reach,
    image: impl Fn([f64; 2]) -> [f64; 2],
) -> [Reach; 2] {
    let corners = [
        [first.least, second.least],
        [first.least, second.greatest],
        [first.greatest, second.least],
        [first.greatest, second.greatest],
    ]
    .map(image);
    [0, 1].map(|k| {
        let values = corners.map(|corner| corner[k]);
        Reach {
            least: values.into_iter().fold(f64::INFINITY, f64::min),
            greatest: values.into_iter().fold(f64::NEG_INFINITY, f64::max),
        }
    })
}
