//! Circles for a ballbar, in the middle of the travels.

use gap_diagnosis::design::Bar;
use machine::MachineFile;
use metrology::Axis;
use metrology::sample::TestPlane;
use reports::evaluate::circles::plane_axes;

use super::super::instruments::Means;
use super::super::programs;
use super::{Offer, SetUp, short};

/// Lengths of a bar, mm; the longest that fits is used.
const LENGTHS_MM: [f64; 4] = [300.0, 150.0, 100.0, 50.0];
/// Feeds, mm/min.
const BAR_FEEDS_MM_MIN: [f64; 2] = [1000.0, 3000.0];
/// Way that the circle leaves at each end of a travel, mm.
const BAR_MARGIN_MM: f64 = 10.0;

pub(super) fn offers(machine: &MachineFile) -> Vec<Offer> {
    let planes = [TestPlane::Xy, TestPlane::Yz, TestPlane::Zx];
    let bars = planes.into_iter().filter_map(|plane| bar(machine, plane));
    bars.flat_map(|(words, bar): (String, Bar)| in_plane(machine, &words, &bar))
        .collect()
}

/// The longest bar in a plane, and the letters of the plane.
fn bar(machine: &MachineFile, plane: TestPlane) -> Option<(String, Bar)> {
    let axes = plane_axes(plane)?;
    let mut centre_mm = [0.0; 3];
    for axis in Axis::LINEAR {
        let [low, high] = machine.linear(axis)?.travel_mm;
        centre_mm[axis.index()] = 0.5 * (low + high);
    }
    let fits = |radius_mm: &f64| {
        axes.iter().all(|axis| {
            let entry = machine.linear(*axis);
            entry.is_some_and(|entry| {
                let half_mm = 0.5 * (entry.travel_mm[1] - entry.travel_mm[0]);
                radius_mm + BAR_MARGIN_MM <= half_mm
            })
        })
    };
    let radius_mm = LENGTHS_MM.into_iter().find(fits)?;
    let bar = Bar {
        plane,
        centre_mm,
        radius_mm,
        feed_mm_s: 0.0,
    };
    Some((format!("{}{}", axes[0], axes[1]), bar))
}

fn in_plane(machine: &MachineFile, words: &str, bar: &Bar) -> Vec<Offer> {
    let [x, y, z] = bar.centre_mm;
    let set_up = SetUp {
        name: format!("ballbar {words}"),
        means: Means::Ballbar,
        words: format!(
            "Put the ballbar of {} mm up in the plane {words}, its centre at X {x:.1}, Y {y:.1}, Z {z:.1} mm. Record it with its own \
             software at the feeds of the programs, both senses, and import its table afterwards (`abbe import`).",
            short(bar.radius_mm)
        ),
    };
    let offer = |feed: f64| {
        let bar = Bar {
            feed_mm_s: feed / 60.0,
            ..bar.clone()
        };
        let program = format!("ballbar_{}_f{feed:.0}.ngc", words.to_lowercase());
        let text = programs::circles(machine, &bar)?;
        let title = format!(
            "ballbar {words} R{} F{} both senses",
            short(bar.radius_mm),
            short(feed)
        );
        let mut offer = Offer::new(title, &set_up, format!("{{do: run, program: {program:?}}}"));
        let _ = offer.programs.insert(program, text);
        offer.bar = Some(bar);
        Some(offer)
    };
    BAR_FEEDS_MM_MIN.into_iter().filter_map(offer).collect()
}
