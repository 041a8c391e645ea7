//! Logs as shops make them: with nights, without pauses, cut, jittered, made once. What they hold is made of exact
//! exponentials, step by step nowhere: a temperature k(t) = A (1 - exp(-t/T)), and what follows it with the lag tau from rest,
//!
//! ```text
//!   y(t) = A (1 - (T exp(-t/T) - tau exp(-t/tau)) / (T - tau))
//! ```

use gap_diagnosis::judgement::CheckId;
use gap_diagnosis::report::{Cause, Status};
use gap_diagnosis::session::{Input, SessionBuilder, SessionConfig};
use gap_diagnosis::{Diagnosis, GapConfig, GoesWith, Note, ThermalFit, diagnose};
use machine::MachineFile;
use metrology::sample::{AxisState, LengthSample, TemperatureSample, TestKind, TestSegment};
use metrology::stamp::Host;
use metrology::{Axis, AxisSet, PerAxis, Stamp};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

const MACHINE: &str = include_str!("../../../../launch_configs/gap_first/machine.yaml");
const BED: &str = "  - {id: bed, place: bed, period_s: 10.0}";
pub const FRONT: &str = "\n  - {id: spindle_front, place: spindle_front, period_s: 10.0}";
const REAR: &str = "\n  - {id: rear_bearing, place: spindle_rear, period_s: 60.0}";
const FRAME: &str = "\n  - {id: frame, place: column, period_s: 4.0}";
const Z_MM: f64 = 100.0;

pub fn machine(more_sensors: &str) -> MachineFile {
    assert!(MACHINE.contains(BED));
    let text = MACHINE.replace(BED, &format!("{BED}{more_sensors}"));
    MachineFile::parse(&text, "machine.yaml").expect("a machine file")
}

fn stamp(time_s: f64) -> Stamp<Host> {
    Stamp::from_nanos((time_s * 1e9).round() as i64 + 1_767_600_000_000_000_000)
}

/// A warm-up of so many kelvin with the time constant `warm_s`.
pub fn warm_k(rise_k: f64, warm_s: f64, time_s: f64) -> f64 {
    rise_k * (1.0 - (-time_s / warm_s).exp())
}

/// What follows it.
pub fn lagged_k(rise_k: f64, warm_s: f64, lag_s: f64, time_s: f64) -> f64 {
    let [slow, fast] = [warm_s, lag_s].map(|tau_s| tau_s * (-time_s / tau_s).exp());
    rise_k * (1.0 - (slow - fast) / (warm_s - lag_s))
}

/// A log that is being made.
pub struct Log {
    builder: SessionBuilder,
    noise: Pcg64Mcg,
}

impl Log {
    pub fn new(machine: &MachineFile, seed: u64) -> Self {
        Self {
            builder: SessionBuilder::new(machine, SessionConfig::default()).expect("a machine"),
            noise: Pcg64Mcg::seed_from_u64(seed),
        }
    }

    pub fn normal(&mut self, size: f64) -> f64 {
        let normal: f64 = StandardNormal.sample(&mut self.noise);
        size * normal
    }

    pub fn segment(&mut self, run: u32, begin: bool, time_s: f64) {
        self.builder.take(Input::Segment(TestSegment {
            begin,
            repeat: run - 1,
            zero_id: 1,
            setup_id: 1,
            features: vec!["Z".to_owned()],
            ..TestSegment::of_kind(TestKind::Dwell, run, stamp(time_s))
        }));
    }

    pub fn row(&mut self, time_s: f64, um: f64, degc: &[(&str, f64)]) {
        let mut commanded = PerAxis::default();
        commanded[Axis::Z] = Z_MM;
        self.builder.take(Input::State(AxisState::standing(
            stamp(time_s),
            Stamp::from_nanos(stamp(time_s).nanos()),
            AxisSet::XYZ,
            commanded,
        )));
        self.builder.take(Input::Length(LengthSample {
            at: stamp(time_s),
            axis: Axis::Z,
            displacement_mm: Z_MM + 1e-3 * um,
            zero_id: 1,
        }));
        for (sensor, degc) in degc {
            self.builder.take(Input::Temperature(TemperatureSample {
                at: stamp(time_s),
                sensor: (*sensor).to_owned(),
                temperature_degc: *degc,
                variance_k2: 0.0,
            }));
        }
    }

    pub fn diagnosed(self, machine: &MachineFile) -> Diagnosis {
        let (session, account) = self.builder.finish().expect("a session");
        assert_eq!(account.left_out.len(), 0, "{account:?}");
        diagnose(machine, &session, &GapConfig::default()).expect("a diagnosis")
    }
}

/// What is named.
pub fn named(diagnosis: &Diagnosis) -> Vec<&Cause> {
    let causes = diagnosis.report.causes.iter();
    causes.filter(|c| c.status != Status::Surrogate).collect()
}

fn only<'d>(diagnosis: &'d Diagnosis, effect: &str) -> &'d Cause {
    match named(diagnosis)[..] {
        [one] if one.effect == effect => one,
        _ => panic!("{:#?} {:#?}", diagnosis.report.causes, diagnosis.notes),
    }
}

/// Sum of the two parts of the growth of a spindle for 10 K, µm.
fn growth_um(cause: &Cause) -> f64 {
    let parts = cause.parameters.iter();
    let parts = parts.filter(|p| p.name == "fast_um" || p.name == "slow_um");
    parts.map(|p| p.value).sum()
}

/// Growth of 3 µm/K behind the spindle's thermometer by 20 min, on six mornings of 90 min; nobody logs at night.
#[test]
fn a_night_that_was_not_logged_is_neither_warm_nor_a_cause() {
    let machine = machine(FRONT);
    let mut log = Log::new(&machine, 61);
    for run in 0..6 {
        let begin_s = 86_400.0 * f64::from(run);
        log.segment(run + 1, true, begin_s);
        for minute in 0..90 {
            let since_s = 60.0 * f64::from(minute);
            let um = -3.0 * lagged_k(6.0, 1800.0, 1200.0, since_s) + log.normal(0.1);
            let degc = 20.0 + warm_k(6.0, 1800.0, since_s) + log.normal(0.02);
            log.row(begin_s + since_s, um, &[("spindle_front", degc)]);
        }
        log.segment(run + 1, false, begin_s + 5340.0);
    }
    let diagnosis = log.diagnosed(&machine);
    let growth = only(&diagnosis, "spindle_growth");
    let sum_um = growth_um(growth);
    assert!((sum_um - 30.0).abs() < 0.6, "{sum_um} {growth:#?}");
    let silent = diagnosis.notes.iter().find_map(|note| match note {
        Note::Unread {
            thermometer,
            hours,
            more,
            ..
        } => Some((thermometer.as_str(), *hours, *more)),
        _ => None,
    });
    let (thermometer, hours, more) = silent.expect("a remark on the nights");
    assert_eq!((thermometer, more), ("spindle_front", 4));
    assert!((hours - 22.5).abs() < 0.05, "{hours}");
}

/// The nose goes up by 3 µm/K at once, in a room that warms by 0.1 K meanwhile: that explains nothing, and the gauge's sign is asked about.
#[test]
fn a_room_that_warms_by_a_tenth_of_a_kelvin_explains_nothing() {
    let machine = machine(FRONT);
    let mut log = Log::new(&machine, 71);
    log.segment(1, true, 0.0);
    for minute in 0..180 {
        let at_s = 60.0 * f64::from(minute);
        let k = warm_k(8.0, 2400.0, at_s);
        let um = 3.0 * k + log.normal(0.1);
        let spindle = 20.0 + k + log.normal(0.02);
        let room = 20.0 + warm_k(0.1, 2400.0, at_s) + log.normal(0.02);
        log.row(at_s, um, &[("spindle_front", spindle), ("bed", room)]);
    }
    log.segment(1, false, 10_740.0);
    let diagnosis = log.diagnosed(&machine);
    let [follows] = &diagnosis.report.follows[..] else {
        panic!("{:#?}", diagnosis.report.follows)
    };
    let [spindle] = &follows.thermometers[..] else {
        panic!("{follows:#?}")
    };
    assert_eq!(
        (follows.channel.as_str(), spindle.thermometer.as_str()),
        ("length.Z", "spindle_front")
    );
    assert!(
        (spindle.um_per_k - 3.0).abs() < 0.03 && follows.share > 0.99,
        "{follows:#?}"
    );
    let fit = diagnosis.notes.iter().find_map(|note| match note {
        Note::GoesWith { found, .. } => Some(found),
        _ => None,
    });
    let alone: Vec<&str> = { fit.expect("a remark").alone.iter() }
        .map(|(id, _)| id.as_str())
        .collect();
    assert_eq!(alone, ["spindle_front"]);
    let shrinks = diagnosis.notes.iter().any(|note| match note {
        Note::ShrinksWarming { um, by_thermometer } => (*um + 30.0).abs() < 3.0 && *by_thermometer,
        _ => false,
    });
    assert!(shrinks, "{:#?}", diagnosis.notes);
    let drift = &diagnosis.figures.drifts[0];
    let off = drift.deviation_um.iter().zip(&drift.model_um);
    assert!(
        off.map(|(read, model)| (read - model).abs())
            .fold(0.0, f64::max)
            < 0.6
    );
    assert_eq!(
        (drift.temperatures.len(), drift.is_by_thermometers),
        (2, true)
    );
}

/// How six equal warm-ups are logged.
pub struct Logged {
    rows: u32,
    every_s: f64,
    pause_s: f64,
    jitter_s: f64,
    rows_of_last: u32,
}

impl Logged {
    pub fn diagnosed(&self, machine: &MachineFile) -> Diagnosis {
        let mut log = Log::new(machine, 44);
        let mut begin_s = 0.0;
        for run in 1..=6 {
            log.segment(run, true, begin_s);
            let rows = if run == 6 {
                self.rows_of_last
            } else {
                self.rows
            };
            let mut since_s = 0.0;
            for row in 0..rows {
                let jitter_s = if row == 0 { 0.0 } else { self.jitter_s };
                let off_s = log.normal(0.4).clamp(-1.0, 1.0) * jitter_s;
                since_s = f64::from(row) * self.every_s + off_s;
                let k = warm_k(8.0, 1200.0, since_s);
                let um = -3.0 * k + log.normal(0.5);
                log.row(begin_s + since_s, um, &[("frame", 22.0 + k)]);
            }
            log.segment(run, false, begin_s + since_s);
            begin_s += f64::from(self.rows) * self.every_s + self.pause_s;
        }
        log.diagnosed(machine)
    }
}

/// z = -3 µm/K of the frame at once, whatever rows there are.
#[test]
fn equal_warm_ups_are_repeats_whatever_rows_and_pauses_they_have() {
    let whole = Logged {
        rows: 60,
        every_s: 60.0,
        pause_s: 3600.0,
        jitter_s: 0.0,
        rows_of_last: 60,
    };
    let often = Logged {
        rows: 240,
        every_s: 15.0,
        rows_of_last: 240,
        ..whole
    };
    let all = [
        ("pause", Logged { ..whole }),
        (
            "no pause",
            Logged {
                pause_s: 0.0,
                ..whole
            },
        ),
        ("often", Logged { ..often }),
        (
            "jitter",
            Logged {
                jitter_s: 1.0,
                ..often
            },
        ),
        (
            "last cut",
            Logged {
                rows_of_last: 20,
                ..often
            },
        ),
    ];
    let machine = machine(FRAME);
    for (what, logged) in all {
        let diagnosis = logged.diagnosed(&machine);
        let bend = only(&diagnosis, "column_bend");
        let size = bend.parameters.iter().find(|p| p.name == "z_um_per_k");
        let size = size.expect("a size");
        assert!(size.low < -3.0 && size.high > -3.0, "{what}: {size:?}");
        assert!((size.value + 3.0).abs() < 0.1, "{what}: {size:?}");
        let floor = &diagnosis.report.noise_floor[0];
        assert!(floor.repeats >= 4, "{what}: {floor:?}");
        assert!((floor.sigma_um - 0.5).abs() < 0.06, "{what}: {floor:?}");
    }
}

/// The test of ISO 230-3 as it is made: one warm-up of three hours, once.
#[test]
fn a_warm_up_that_was_logged_once_is_diagnosed_by_its_last_hour() {
    let machine = machine(FRONT);
    let mut log = Log::new(&machine, 80);
    log.segment(1, true, 0.0);
    for minute in 0..=180 {
        let at_s = 60.0 * f64::from(minute);
        let um = -3.0 * lagged_k(8.0, 2400.0, 1200.0, at_s) + log.normal(0.1);
        let degc = 20.0 + warm_k(8.0, 2400.0, at_s) + log.normal(0.02);
        let air = 20.0 + log.normal(0.02);
        log.row(at_s, um, &[("spindle_front", degc), ("ambient", air)]);
    }
    log.segment(1, false, 10_800.0);
    let diagnosis = log.diagnosed(&machine);
    let growth = only(&diagnosis, "spindle_growth");
    let sum_um = growth_um(growth);
    assert!((sum_um - 30.0).abs() < 1.5, "{sum_um} {growth:#?}");
    assert!(growth.confidence <= 0.8, "{}", growth.confidence);
    assert_eq!(diagnosis.report.shrink.held_out_runs, [5, 6]);
    let floor = &diagnosis.report.noise_floor[0];
    assert_eq!(floor.repeats, 1);
    assert!((floor.sigma_um - 0.1).abs() < 0.03, "{floor:?}");
    let notes = &diagnosis.notes;
    let is_within = |note: &Note| matches!(note, Note::NoiseWithin { .. });
    assert!(notes.iter().any(is_within), "{notes:#?}");
    let in_parts = |note: &Note| matches!(note, Note::InParts { parts: 6, .. });
    assert!(notes.iter().any(in_parts), "{notes:#?}");
    let found = notes.iter().find_map(|note| match note {
        Note::GoesWith { found, .. } => Some(found),
        _ => None,
    });
    let found = found.expect("what it goes with");
    let [by] = &found.by[..] else {
        panic!("{found:?}");
    };
    assert_eq!(by.thermometer, "spindle_front");
    assert!((by.lag_min - 20.0).abs() < 0.7, "{by:?}");
    assert!((by.um_per_k + 3.0).abs() < 0.06, "{by:?}");
}

/// A spindle that grows with its rear bearing by 0.93 µm/K an hour late, above a table that grows by 3.2 µm/K at once; the
/// front bearing is cooled and settles early.
#[test]
fn of_two_thermometers_of_a_spindle_the_one_that_predicts_is_reported_with_its_lag() {
    let machine = machine(&[FRONT, REAR].concat());
    let mut log = Log::new(&machine, 3);
    let (runs, rows, every_s, hour_s) = (12, 120, 120.0, 3600.0);
    for run in 0..runs {
        let begin_s = f64::from(run * rows) * every_s;
        log.segment(run + 1, true, begin_s);
        for row in 0..rows {
            let at_s = begin_s + f64::from(row) * every_s;
            let day = std::f64::consts::TAU * at_s / (24.0 * hour_s);
            let table_k = 2.6 * at_s / (76.0 * hour_s) + 0.15 * day.sin();
            let rear_k = lagged_k(24.5, 6.0 * hour_s, hour_s, at_s);
            let um = 0.93 * rear_k - 3.2 * table_k + log.normal(0.15);
            let wave_k = 0.35 * (24.0 / 7.0 * day).sin();
            let all_degc = [
                (
                    "spindle_front",
                    25.5 + warm_k(11.5, 2.2 * hour_s, at_s) + wave_k,
                ),
                ("rear_bearing", 28.0 + warm_k(24.5, 6.0 * hour_s, at_s)),
                ("bed", 19.0 + table_k),
                ("ambient", 20.0),
            ];
            let all_degc = all_degc.map(|(id, degc)| (id, degc + log.normal(0.02)));
            log.row(at_s, um, &all_degc);
        }
        log.segment(run + 1, false, begin_s + f64::from(rows - 1) * every_s);
    }
    let diagnosis = log.diagnosed(&machine);
    let found = diagnosis.notes.iter().find_map(|note| match note {
        Note::GoesWith { found, .. } => Some(found),
        _ => None,
    });
    let found = found.expect("what it goes with");
    let of = |id: &str| {
        let by = found.by.iter().find(|by| by.thermometer == id);
        by.unwrap_or_else(|| panic!("{id}: {found:#?}"))
    };
    let rear = of("rear_bearing");
    assert!((rear.lag_min - 60.0).abs() < 5.0, "{found:#?}");
    assert!((rear.um_per_k - 0.93).abs() < 0.03, "{found:#?}");
    let error = rear.standard_error_um_per_k;
    assert!(error > 1e-4 && error < 0.03, "{found:#?}");
    assert!((of("bed").um_per_k + 3.2).abs() < 0.2, "{found:#?}");
    assert!(found.share > 0.99, "{found:#?}");
}

/// Noise that neighbouring rows share by so much.
const SHARED: f64 = 0.7;

/// Four warm-ups of other heats, so that none repeats another, and noise that neighbouring rows share.
#[test]
fn noise_that_neighbouring_rows_share_hides_no_cause_of_a_log() {
    let machine = machine(FRONT);
    let mut log = Log::new(&machine, 62);
    let (mut shared_um, free) = (0.0, (1.0 - SHARED * SHARED).sqrt());
    for (run, rise_k) in [8.0, 5.0, 11.0, 6.5].into_iter().enumerate() {
        let run = u32::try_from(run).unwrap();
        let begin_s = 86_400.0 * f64::from(run);
        log.segment(run + 1, true, begin_s);
        for minute in 0..120 {
            let since_s = 60.0 * f64::from(minute);
            shared_um = SHARED * shared_um + log.normal(0.2 * free);
            let um = -1.5 * lagged_k(rise_k, 1800.0, 600.0, since_s) + shared_um;
            let degc = 20.0 + warm_k(rise_k, 1800.0, since_s) + log.normal(0.02);
            log.row(begin_s + since_s, um, &[("spindle_front", degc)]);
        }
        log.segment(run + 1, false, begin_s + 7200.0);
    }
    let diagnosis = log.diagnosed(&machine);
    let cause = only(&diagnosis, "spindle_growth");
    let by_thermometer = { cause.why.iter() }.find(|c| c.check == CheckId::OwnThermometer);
    assert!(
        by_thermometer.is_some_and(|c| !c.has_failed()),
        "{cause:#?}"
    );
}

#[test]
fn a_growth_is_shown_with_the_digits_that_its_error_justifies() {
    let shown = |um_per_k: f64, standard_error_um_per_k: f64| {
        let by = GoesWith {
            thermometer: "bed".to_owned(),
            um_per_k,
            standard_error_um_per_k,
            lag_min: 0.0,
        };
        let found = ThermalFit {
            by: vec![by],
            share: 0.9,
            alone: vec![],
            near: vec![],
        };
        let channel = "length.X".to_owned();
        Note::GoesWith { channel, found }.to_string()
    };
    for (value, error, wanted) in [
        (0.0041, 0.0003, ", 0.00410 µm/K"),
        (0.0041, 0.0, ", 0.00410 µm/K"),
        (-3.2, 0.04, ", -3.200 µm/K"),
        (12.0, 0.3, ", 12.00 µm/K"),
    ] {
        let text = shown(value, error);
        assert!(text.contains(wanted), "{text}");
    }
}
