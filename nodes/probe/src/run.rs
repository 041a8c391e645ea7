//! The touches of one test segment.

use std::collections::BTreeSet;

use machine::cycle::FeatureId;
use metrology::sample::{ProbedPoint, Rejection, TestKind, TestSegment};

use crate::correction::TouchUncertainty;
use crate::latency_in_use::LatencyInUse;

/// One open test segment and what it has touched so far.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub(crate) segment: TestSegment,
    /// Effective radius of the stylus, mm; `None`: an unknown stylus, nothing is evaluated.
    pub(crate) ball_radius_mm: Option<f64>,
    pub(crate) touches: Vec<RunTouch>,
}

/// One touch of a run.
#[derive(Clone, Debug)]
pub(crate) struct RunTouch {
    pub(crate) point: ProbedPoint,
    pub(crate) uncertainty: TouchUncertainty,
    /// The latency that corrected it; `None` where none did.
    pub(crate) latency: Option<LatencyInUse>,
}

impl RunTouch {
    pub(crate) fn is_usable(&self) -> bool {
        self.point.rejection == Rejection::None
    }
}

/// Whether touches in a segment of this kind belong together.
pub(crate) const fn is_probing(kind: TestKind) -> bool {
    matches!(
        kind,
        TestKind::Latency
            | TestKind::Block
            | TestKind::Touch
            | TestKind::Plane
            | TestKind::Bore
            | TestKind::Sphere
            | TestKind::Rotary
            | TestKind::RotaryVerification
    )
}

impl Run {
    pub(crate) const fn number(&self) -> u32 {
        self.segment.run
    }

    /// Touches whose feature passes.
    pub(crate) fn touches_of<'a>(
        &'a self,
        mut wanted: impl FnMut(FeatureId<'_>) -> bool + 'a,
    ) -> impl Iterator<Item = &'a RunTouch> {
        self.touches
            .iter()
            .filter(move |touch| FeatureId::parse(&touch.point.feature_id).is_some_and(&mut wanted))
    }

    /// Whether each of these features, blocks and artefacts was touched, by a touch that counts or by a rejected one.
    pub(crate) fn has_touched(&self, names: &[String]) -> bool {
        let mut touched = BTreeSet::new();
        for touch in &self.touches {
            let name = touch.point.feature_id.as_str();
            touched.insert(name);
            touched.extend(FeatureId::parse(name).map(|id| id.owner()));
        }
        names.iter().all(|name| touched.contains(name.as_str()))
    }

    /// Blocks and artefacts that the segment names or that were touched, in this order.
    pub(crate) fn owners(&self) -> Vec<String> {
        let named = self.segment.features.iter().map(String::as_str);
        let touched = self
            .touches
            .iter()
            .map(|touch| touch.point.feature_id.as_str());
        let mut seen = BTreeSet::new();
        named
            .chain(touched)
            .map(|name| FeatureId::parse(name).map_or(name, |id| id.owner()))
            .filter(|name| seen.insert(*name))
            .map(str::to_owned)
            .collect()
    }
}
