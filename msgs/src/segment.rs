//! Begin and end of tests.

use metrology::sample::{Sense, TestKind, TestPlane, TestSegment as Inner};

use crate::msg::TestSegment;
use crate::wire::{Allowed, Reader, lengths, metres, point, time};
use crate::{Place, Wire, WireError};

pub(crate) const TEST_KINDS: [TestKind; 20] = [
    TestKind::Latency,
    TestKind::Block,
    TestKind::Touch,
    TestKind::Plane,
    TestKind::Bore,
    TestKind::Sphere,
    TestKind::Circle,
    TestKind::Line,
    TestKind::Corner,
    TestKind::Positioning,
    TestKind::Dwell,
    TestKind::Production,
    TestKind::Verification,
    TestKind::Arc,
    TestKind::Spike,
    TestKind::ArcWithLine,
    TestKind::TwoArcs,
    TestKind::Diagonal,
    TestKind::Rotary,
    TestKind::RotaryVerification,
];

pub(crate) fn kind_code(kind: TestKind) -> u8 {
    match kind {
        TestKind::Latency => TestSegment::KIND_LATENCY,
        TestKind::Block => TestSegment::KIND_BLOCK,
        TestKind::Touch => TestSegment::KIND_TOUCH,
        TestKind::Plane => TestSegment::KIND_PLANE,
        TestKind::Bore => TestSegment::KIND_BORE,
        TestKind::Sphere => TestSegment::KIND_SPHERE,
        TestKind::Circle => TestSegment::KIND_CIRCLE,
        TestKind::Line => TestSegment::KIND_LINE,
        TestKind::Corner => TestSegment::KIND_CORNER,
        TestKind::Positioning => TestSegment::KIND_POSITIONING,
        TestKind::Dwell => TestSegment::KIND_DWELL,
        TestKind::Production => TestSegment::KIND_PRODUCTION,
        TestKind::Verification => TestSegment::KIND_VERIFICATION,
        TestKind::Arc => TestSegment::KIND_ARC,
        TestKind::Spike => TestSegment::KIND_SPIKE,
        TestKind::ArcWithLine => TestSegment::KIND_ARC_WITH_LINE,
        TestKind::TwoArcs => TestSegment::KIND_TWO_ARCS,
        TestKind::Diagonal => TestSegment::KIND_DIAGONAL,
        TestKind::Rotary => TestSegment::KIND_ROTARY,
        TestKind::RotaryVerification => TestSegment::KIND_ROTARY_VERIFICATION,
    }
}

pub(crate) const PLANES: [TestPlane; 4] =
    [TestPlane::None, TestPlane::Xy, TestPlane::Yz, TestPlane::Zx];

/// `TestSegment` and `GridSample` number the planes alike.
pub(crate) fn plane_code(plane: TestPlane) -> u8 {
    match plane {
        TestPlane::None => TestSegment::PLANE_NONE,
        TestPlane::Xy => TestSegment::PLANE_XY,
        TestPlane::Yz => TestSegment::PLANE_YZ,
        TestPlane::Zx => TestSegment::PLANE_ZX,
    }
}

pub(crate) const SENSES: [Sense; 3] = [Sense::None, Sense::Clockwise, Sense::CounterClockwise];

pub(crate) fn sense_code(sense: Sense) -> u8 {
    match sense {
        Sense::None => TestSegment::SENSE_NONE,
        Sense::Clockwise => TestSegment::SENSE_CLOCKWISE,
        Sense::CounterClockwise => TestSegment::SENSE_COUNTERCLOCKWISE,
    }
}

impl Wire for TestSegment {
    type Inner = Inner;

    fn set_from_inner(&mut self, inner: &Inner) {
        self.header.stamp = time(inner.at);
        self.run = inner.run;
        self.begin = inner.begin;
        self.kind = kind_code(inner.kind);
        self.plane = plane_code(inner.plane);
        self.centre = point(&inner.centre_mm);
        self.radius_m = metres(inner.radius_mm);
        self.feed_m_s = metres(inner.feed_mm_s);
        self.sense = sense_code(inner.sense);
        self.repeat = inner.repeat;
        self.stylus.clone_from(&inner.stylus);
        self.tool_offset = lengths(&inner.tool_offset_mm);
        self.stations = inner.stations;
        self.zero_id = inner.zero_id;
        self.setup_id = inner.setup_id;
        self.cold = inner.cold;
        self.features.clone_from(&inner.features);
        self.completed = inner.completed;
    }

    fn to_inner(&self) -> Result<Inner, WireError> {
        let read = Reader::of::<Self>();
        Ok(Inner {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            run: self.run,
            begin: self.begin,
            kind: read.variant("kind", Place::Whole, self.kind, &TEST_KINDS, kind_code)?,
            plane: read.variant("plane", Place::Whole, self.plane, &PLANES, plane_code)?,
            centre_mm: read.point_mm("centre", &self.centre, Allowed::Finite)?,
            radius_mm: read.length_mm("radius_m", self.radius_m)?,
            feed_mm_s: read.length_mm("feed_m_s", self.feed_m_s)?,
            sense: read.variant("sense", Place::Whole, self.sense, &SENSES, sense_code)?,
            repeat: self.repeat,
            stylus: read.name("stylus", &self.stylus)?,
            tool_offset_mm: read.lengths_mm("tool_offset", &self.tool_offset)?,
            stations: self.stations,
            zero_id: self.zero_id,
            setup_id: self.setup_id,
            cold: self.cold,
            features: read.names("features", &self.features)?,
            completed: self.completed,
        })
    }
}
