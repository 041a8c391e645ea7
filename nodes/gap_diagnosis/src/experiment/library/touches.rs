//! Touches: at three feeds, with another stylus, around an artefact.

use machine::file::ArtefactEntry;
use nalgebra::Vector3;
use twin::Instrument;

use super::{OTHER_PLACE_MIN, SAME_PLACE_MIN, Shop};
use crate::experiment::{Experiment, Pass, PlannedTouch, short};

impl Shop<'_> {
    pub(super) fn touches(&self) -> Vec<Experiment> {
        let known = self.known_touches();
        let mounted = self.session.runs.iter().find(|run| !run.touches.is_empty());
        let mounted = mounted.map_or(self.machine.probe.mounted.as_str(), |run| {
            run.segment.stylus.as_str()
        });
        let setup_min = if self.had.contains(&Instrument::Touch) {
            SAME_PLACE_MIN
        } else {
            self.setup_min(Instrument::Touch)
        };
        let usual_mm_s = self.machine.probe.feed_mm_min / 60.0;
        let mut all = Vec::new();
        if !known.is_empty() {
            let words = [0.5, 1.0, 4.0].map(|share| short(share * usual_mm_s * 60.0));
            let title = format!(
                "the same touches at F{}, F{} and F{}",
                words[0], words[1], words[2]
            );
            all.push(experiment(
                title,
                at_feeds(&known, usual_mm_s, &[0.5, 1.0, 4.0]),
                mounted,
                setup_min,
            ));
            let styli = self.machine.probe.styli.keys();
            for stylus in styli.filter(|stylus| *stylus != mounted) {
                let title = format!("the same touches with stylus {stylus}");
                all.push(experiment(
                    title,
                    at_feeds(&known, usual_mm_s, &[1.0]),
                    stylus,
                    OTHER_PLACE_MIN,
                ));
            }
        }
        for (id, ring) in self.rings() {
            let title = format!(
                "12 touches around {id} at F{} and F{}",
                short(usual_mm_s * 60.0),
                short(usual_mm_s * 240.0)
            );
            all.push(experiment(
                title,
                at_feeds(&ring, usual_mm_s, &[1.0, 4.0]),
                mounted,
                setup_min,
            ));
        }
        all
    }

    /// Each surface that the session touched, once.
    fn known_touches(&self) -> Vec<PlannedTouch> {
        let mut known = Vec::<PlannedTouch>::new();
        for touch in self.session.runs.iter().flat_map(|run| &run.touches) {
            let is_known = known.iter().any(|other| {
                other.feature_id == touch.feature_id
                    && (Vector3::from(other.approach) - touch.approach).norm() < 0.05
            });
            if !is_known && known.len() < 12 {
                known.push(PlannedTouch {
                    feature_id: touch.feature_id.clone(),
                    approach: touch.approach.into(),
                    at_mm: touch.position.xyz().into(),
                    feed_mm_s: touch.feed_mm_s,
                });
            }
        }
        known
    }

    /// Twelve touches around each round artefact of the machine file.
    fn rings(&self) -> Vec<(String, Vec<PlannedTouch>)> {
        let ball_mm = self.machine.ball_radius_mm();
        let ring = |id: &String, centre: &[f64; 3], radius_mm: f64, inward: f64| {
            let touch = |k: u32| {
                let (sin, cos) = (f64::from(k) * std::f64::consts::FRAC_PI_6).sin_cos();
                let outward = Vector3::new(cos, sin, 0.0);
                PlannedTouch {
                    feature_id: id.clone(),
                    approach: (-inward * outward).into(),
                    at_mm: (Vector3::from(*centre) + outward * (radius_mm + inward * ball_mm))
                        .into(),
                    feed_mm_s: 1.0,
                }
            };
            (id.clone(), (0..12).map(touch).collect())
        };
        let of = |artefact: &ArtefactEntry| match artefact {
            ArtefactEntry::Sphere {
                id,
                centre_mm,
                radius_mm,
            }
            | ArtefactEntry::Boss {
                id,
                centre_mm,
                radius_mm,
            } => Some(ring(id, centre_mm, *radius_mm, 1.0)),
            ArtefactEntry::Bore {
                id,
                centre_mm,
                radius_mm,
            } => Some(ring(id, centre_mm, *radius_mm, -1.0)),
            ArtefactEntry::Plane { .. } => None,
        };
        self.machine.artefacts.iter().filter_map(of).collect()
    }
}

/// Each touch twice at each of some shares of the usual feed.
fn at_feeds(from: &[PlannedTouch], usual_mm_s: f64, shares: &[f64]) -> Vec<PlannedTouch> {
    let at = |share: &f64| {
        let feed_mm_s = usual_mm_s * share;
        let touches = from.iter().cloned();
        touches
            .map(move |touch| PlannedTouch { feed_mm_s, ..touch })
            .collect::<Vec<_>>()
    };
    (0..2).flat_map(|_| shares).flat_map(at).collect()
}

fn experiment(
    title: String,
    touches: Vec<PlannedTouch>,
    stylus: &str,
    setup_min: f64,
) -> Experiment {
    let stylus = stylus.to_owned();
    Experiment {
        title,
        passes: vec![Pass::Touches { touches, stylus }],
        setup_min,
    }
}
