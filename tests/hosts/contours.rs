//! Contours whose readings are stamped on one host, and the positions of the axes on another, with clocks 1.4 s apart.

use std::path::Path;
use std::time::Duration;

use abbe_msgs::topics;
use abbe_tests::computer_clock::ClockError;
use abbe_tests::hosts::bag;
use abbe_tests::hosts::network::Network;
use abbe_tests::hosts::site::{Site, file_of, parameter};
use abbe_tests::hosts::switch::{Link, Way};
use abbe_tests::scenario::Scenario;
use metrology::Axis;
use metrology::sample::{AxisState, GridSample};
use metrology::stamp::{Host, Stamp};
use nalgebra::{DMatrix, DVector};

/// Jitter of a whole way between two hosts, from nothing to this, s.
const JITTER_S: f64 = 1e-3;
const HALF_WAY: Way = Way {
    delay_s: 2.5e-3,
    jitter_s: JITTER_S / 2.0,
    loss: 0.005,
    reorder: 0.005,
};
/// What a host's clock may be off by: 50 us, and a tenth of the jitter.
const LIMIT_S: f64 = 50e-6 + 0.1 * JITTER_S;
/// What readings may scatter by: the way in those 50 us at 100 mm/s. 0.5 to 2.2 um were seen.
const LIMIT_UM: f64 = 5.0;
/// 100 mm/s: a clock that is off by 0.1 ms reads 10 um.
const PLAN: &str = "title: circles in both senses
steps:
  - {do: wait, seconds: 10.0}
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 50.0, feed_mm_min: 6000.0, sense: both, on_the_fly: true, repeats: 2}
  - {do: wait, seconds: 2.0}
";
/// How long the cell works.
const WORK: Duration = Duration::from_secs(48);

#[test]
fn a_grid_on_another_host_reads_contours_as_if_it_had_the_controllers_clock() {
    let Some(network) = Network::of(&["controller", "instrument", "models"], 64, 7) else {
        return;
    };
    network.links(Link::even(HALF_WAY));
    let scenario = Scenario::copy_of("grid_xy");
    scenario.write("plan.yaml", PLAN);
    let into = scenario.path("bag");
    let clocks = [ClockError::of(0.6, 40e-6), ClockError::of(-0.8, -25e-6)];

    let mut models = Site::new(&network, "models", Some(clocks[1]));
    let mut instrument = Site::new(&network, "instrument", Some(clocks[0]));
    let mut controller = Site::new(&network, "controller", None);
    models.start(
        "recorder",
        parameter("bag", &into.display().to_string()).into(),
    );
    models.start("grid_encoder", file_of(&scenario, "grid_encoder"));
    instrument.start_program(env!("CARGO_BIN_EXE_grid_driver"), vec![]);
    let mut machine = file_of(&scenario, "fake_cnc");
    machine.extend(["-r", "grid/position:=instrument/position"].map(str::to_owned));
    controller.start("fake_cnc", machine);
    models.start("sequencer", file_of(&scenario, "sequencer"));
    std::thread::sleep(WORK);
    instrument.stop();
    models.stop();
    controller.stop();

    let (lag_s, n) = lag(&into);
    eprintln!("{n} readings: stamps are late by {:.1} us", lag_s * 1e6);
    assert!(n > 10_000, "{n} readings");
    assert!(lag_s.abs() <= LIMIT_S, "{lag_s} s");
    let models = bag::messages(&into, &topics::GEOMETRY_MODEL);
    let (_, model) = models.last().unwrap();
    let scatter_um = model.residual_standard_deviation_mm * 1e3;
    eprintln!(
        "geometry of {} readings, scatter {scatter_um:.2} um",
        model.n_samples
    );
    assert!(scatter_um < LIMIT_UM, "{scatter_um} um");
}

/// Where the motors were, mm, and how fast they were, mm/s, at a time between two states.
fn motion(states: &[(Stamp<Host>, AxisState)], at: Stamp<Host>) -> Option<[[f64; 2]; 2]> {
    let later = states.partition_point(|(_, state)| state.received_at <= at);
    let (before, after) = (&states.get(later.checked_sub(1)?)?.1, &states.get(later)?.1);
    let between_s = (after.received_at - before.received_at).as_secs_f64();
    let share = (at - before.received_at).as_secs_f64() / between_s;
    Some([Axis::X, Axis::Y].map(|axis| {
        let way_mm = after.motor[axis] - before.motor[axis];
        [before.motor[axis] + share * way_mm, way_mm / between_s]
    }))
}

/// By how much the stamps of readings are late against those of positions, s, and of how many readings: the speed's share in a
/// reading less what a plate that lies askew reads of both axes. Circles in both senses tell the one from the other.
fn lag(bag: &Path) -> (f64, usize) {
    let mut states = bag::messages(bag, &topics::AXES_STATE);
    states.sort_by_key(|(_, state)| state.received_at);
    let readings: Vec<GridSample> = bag::messages(bag, &topics::GRID_POSITION)
        .into_iter()
        .map(|(_, reading)| reading)
        .collect();
    let moving: Vec<(&GridSample, [[f64; 2]; 2])> = readings
        .iter()
        .filter_map(|reading| Some((reading, motion(&states, reading.at)?)))
        .filter(|(_, [x, y])| x[1].hypot(y[1]) > 50.0)
        .collect();
    let speeds = |place: usize| {
        let rows = DMatrix::from_fn(moving.len(), 4, |row, column| {
            let own = moving[row].1;
            [1.0, own[0][0], own[1][0], own[place][1]][column]
        });
        let read = moving
            .iter()
            .map(|(reading, _)| [reading.u_mm, reading.v_mm][place]);
        let read = DVector::from_iterator(moving.len(), read);
        let fitted = rows.svd(true, true).solve(&read, 1e-12).unwrap();
        -fitted[3] / fitted[1 + place]
    };
    (0.5 * (speeds(0) + speeds(1)), moving.len())
}
