//! Bins and programs of short logs, by hand.

use super::*;
use crate::condition::words;
use crate::mapping::{MapFile, Mapping};
use crate::observation::read_stamp;

const MAP: &str = "values:\n  Xabs: {is: position, axis: X, unit: MILLIMETER}\n  Srpm: {is: spindle_speed, name: spindle, unit: REVOLUTION/MINUTE}\n";

fn order() -> ShiftOrder {
    ShiftOrder {
        from: read_stamp("2016-11-29T10:00:00Z").unwrap(),
        to: read_stamp("2016-11-29T10:00:30Z").unwrap(),
        bin_s: 10.0,
        slice_s: 20.0,
        spindle: "spindle".to_owned(),
        window_mm: PerAxis::from_fn(|_| (0.0, 100.0)),
        clear_mm: 240.0,
        feed_limit_mm_s: 200.0,
        spindle_limit_rpm: 12_000.0,
    }
}

fn mapping() -> Mapping {
    Mapping::new(&MapFile::from_yaml(MAP).unwrap()).unwrap()
}

const LOG: [&str; 7] = [
    "2016-11-29T09:59:00Z|Srpm|600|Xabs|5",
    "2016-11-29T10:00:04Z|Xabs|35",
    "2016-11-29T10:00:05Z|Srpm|1200",
    "2016-11-29T10:00:06Z|Xabs|5",
    "2016-11-29T10:00:20Z|Srpm|UNAVAILABLE",
    "2016-11-29T10:00:21Z|Xabs|UNAVAILABLE",
    "2016-11-29T10:00:22Z|Xabs|500",
];

/// By hand: half of the first bin at 600, half at 1200; 30 mm forth and back; absent, it stands.
#[test]
fn eq1_eq2_a_log_becomes_mean_speeds_and_travels() {
    let bins = bins(LOG.join("\n").as_bytes(), &mapping(), &order())
        .unwrap()
        .bins;
    let rpm = bins
        .iter()
        .map(|bin| bin.spindle_rad_s * 30.0 / std::f64::consts::PI);
    let rpm: Vec<_> = rpm.map(|rpm| rpm.round() as i64).collect();
    assert_eq!(rpm, [900, 1200, 0]);
    let travel: Vec<_> = bins.iter().map(|bin| bin.travel_mm[Axis::X]).collect();
    assert!((travel[0] - 60.0).abs() < 1e-12, "{travel:?}");
    assert!(travel[1..].iter().all(|travel_mm| *travel_mm == 0.0));
}

/// By hand: no speed from 20 s on, where the log says that it is unavailable.
#[test]
fn a_time_without_a_speed_is_named_and_none_at_all_is_refused() {
    let told = |lines: &[&str]| bins(lines.join("\n").as_bytes(), &mapping(), &order());
    let shift = told(&LOG).unwrap();
    let spans: Vec<_> = shift
        .without_spindle
        .iter()
        .map(|(a, b)| (words(*a), words(*b)))
        .collect();
    assert_eq!(spans.len(), 1, "{spans:?}");
    assert!(
        spans[0].0.contains("10:00:20") && spans[0].1.contains("10:00:30"),
        "{spans:?}"
    );
    let without: Vec<&str> = LOG
        .iter()
        .copied()
        .filter(|line| !line.contains("Srpm"))
        .collect();
    let refused = told(&without).unwrap_err().to_string();
    assert!(
        refused.contains("spindle \"spindle\": the log has no speed of it"),
        "{refused}"
    );
}

/// By hand: the log has X until 10:00:06 and from 10:00:22 on; Y, which the mapping has, is not in it.
#[test]
fn times_without_a_position_and_positions_that_are_not_followed_are_named() {
    let map = "values:\n  Xabs: {is: position, axis: X, unit: MILLIMETER}\n  Yabs: {is: position, axis: Y, unit: MILLIMETER}\n  Babs: {is: position, axis: B, unit: DEGREE}\n  Srpm: {is: spindle_speed, name: spindle, unit: REVOLUTION/MINUTE}\n";
    let mapping = Mapping::new(&MapFile::from_yaml(map).unwrap()).unwrap();
    let log = LOG
        .join("\n")
        .replace("10:00:06Z|Xabs|5", "10:00:06Z|Xabs|UNAVAILABLE");
    let shift = bins(log.as_bytes(), &mapping, &order()).unwrap();
    let seconds = |span: &(Stamp<Machine>, Stamp<Machine>)| {
        [span.0, span.1].map(|at| (at - order().from).as_secs_f64().round())
    };
    let found: Vec<_> = shift
        .without_position
        .iter()
        .map(|(axis, spans)| (*axis, spans.iter().map(seconds).collect::<Vec<_>>()))
        .collect();
    let wanted = vec![(Axis::X, vec![[6.0, 22.0]]), (Axis::Y, vec![[0.0, 30.0]])];
    assert_eq!(found, wanted);
    assert_eq!(shift.not_followed, ["Babs"]);
    assert!(!shift.is_whole && shift.is_covered);
}

/// By hand: a line every second, but for a hole; one of two minutes at most is a machine that changed nothing.
#[test]
fn a_log_with_a_hole_is_not_whole_and_covers_its_range() {
    let mut order = order();
    order.to = order.from + Span::from_secs_f64(1200.0);
    for (hole_s, is_whole) in [
        (0, true),
        (60, true),
        (119, true),
        (130, false),
        (600, false),
    ] {
        let at = |s: i64| words(order.from + Span::from_secs_f64(s as f64));
        let seconds = (0..=1200).filter(|s| *s <= 300 || *s > 300 + hole_s);
        let lines = seconds.map(|s| format!("{}|Srpm|600|Xabs|{}\n", at(s), s % 7));
        let log: String = lines.collect();
        let shift = bins(log.as_bytes(), &mapping(), &order).unwrap();
        assert_eq!(
            (shift.is_whole, shift.is_covered),
            (is_whole, true),
            "{hole_s} s"
        );
        assert_eq!(shift.silent.is_empty(), is_whole, "{hole_s} s");
    }
}

#[test]
fn eq3_a_program_goes_the_travel_within_its_window_and_lasts_the_time() {
    let bins = bins(LOG.join("\n").as_bytes(), &mapping(), &order())
        .unwrap()
        .bins;
    let programs = programs(&bins, "a shift", &order()).unwrap();
    let first = "(frame: machine) (a shift, part 1)\nG21 G90 G17\nG0 Z240\nG0 X50 Y50\nG0 Z50\nS900 M3\nG1 X80 F360\nG1 X50 F360\nS1200 M3\nG4 P10\nG0 Z240\nM5\nM2\n";
    let second = "(frame: machine) (a shift, part 2)\nG21 G90 G17\nG0 Z240\nG0 X50 Y50\nG0 Z50\nG4 P10\nG0 Z240\nM2\n";
    assert_eq!(programs, [first, second]);
}

/// How long the lines of a program last that are no rapid motion, s.
fn lasts_s(program: &str) -> f64 {
    let mut at_mm = [0.0_f64; 3];
    let mut total_s = 0.0;
    for line in program.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        let word = |letter: char| {
            let mut found = words.iter().filter_map(|word| word.strip_prefix(letter));
            found.next().and_then(|value| value.parse::<f64>().ok())
        };
        let before_mm = at_mm;
        for (idx, letter) in ['X', 'Y', 'Z'].into_iter().enumerate() {
            at_mm[idx] = word(letter).unwrap_or(at_mm[idx]);
        }
        let way_mm = (0..3).map(|idx| (at_mm[idx] - before_mm[idx]).powi(2));
        match words[0] {
            "G1" => total_s += way_mm.sum::<f64>().sqrt() / word('F').unwrap() * 60.0,
            "G4" => total_s += word('P').unwrap(),
            _ => {}
        }
    }
    total_s
}

#[test]
fn lines_of_little_travel_last_their_time() {
    for travel_mm in [0.0, 0.01, 0.012, 0.0199, 0.1, 3.0, 700.0] {
        let bin = Bin {
            spindle_rad_s: 100.0,
            travel_mm: PerAxis::from_fn(|axis| match axis {
                Axis::X => travel_mm,
                Axis::Y => travel_mm / 7.0,
                _ => 0.0,
            }),
        };
        let order = order();
        let programs = programs(&[bin; 6], "a shift", &order).unwrap();
        let lasted_s: f64 = programs.iter().map(|program| lasts_s(program)).sum();
        let wanted_s = 6.0 * order.bin_s;
        assert!(
            (lasted_s / wanted_s - 1.0).abs() < 2e-4,
            "{travel_mm} mm: {lasted_s} s"
        );
    }
}

#[test]
fn what_the_other_machine_cannot_is_refused() {
    let mut slow = order();
    slow.feed_limit_mm_s = 5.0;
    let bins = bins(LOG.join("\n").as_bytes(), &mapping(), &slow)
        .unwrap()
        .bins;
    let refused = programs(&bins, "a", &slow).unwrap_err().to_string();
    assert_eq!(
        refused,
        "at 0 s: feed 360 mm/min, limit 300 mm/min: take longer bins"
    );
    let mut narrow = order();
    narrow.window_mm[Axis::X] = (0.0, 1e-5);
    let refused = programs(&bins, "a", &narrow).unwrap_err().to_string();
    assert!(
        refused.starts_with("the travels of the log need 120000"),
        "{refused}"
    );
    assert!(
        refused.contains("limit 1000000: widen the windows"),
        "{refused}"
    );
    for (limit_rpm, words) in [
        (1199.0, "at 10 s: S1200, limit 1199 1/min"),
        (0.0, "at 0 s: S900, limit 0 1/min"),
    ] {
        let mut small = order();
        small.spindle_limit_rpm = limit_rpm;
        let refused = programs(&bins, "a", &small).unwrap_err().to_string();
        assert!(refused.starts_with(words), "{refused}");
        assert!(refused.contains("spindle.max_speed_rpm"), "{refused}");
    }
    slow.spindle = "main".to_owned();
    let refused = super::bins(LOG.join("\n").as_bytes(), &mapping(), &slow).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "the mapping has no spindle speed \"main\": give one that name, or name another as spindle in the order"
    );
}

/// A clock that is set back, far or by less than a leap, and a log that is there twice: each time counts once.
#[test]
fn a_time_that_is_told_twice_counts_as_it_was_told_first() {
    let wanted = bins(LOG.join("\n").as_bytes(), &mapping(), &order());
    let wanted = wanted.unwrap().bins;
    // A pause of a minute between its first two lines would be a leap ahead, and back at the second pass.
    let (first, others) = LOG.split_first().unwrap();
    let once = format!(
        "{first}\n2016-11-29T09:59:30Z|Xabs|5\n{}",
        others.join("\n")
    );
    let twice = [once.as_str(), once.as_str()].join("\n");
    // By hand: 1/min and mm of the first bin that no pass alone has.
    let back = "2016-11-29T09:59:00Z|Srpm|600|Xabs|5\n2016-11-29T10:00:04Z|Xabs|35\n2016-11-29T10:00:05Z|Srpm|1200\n2016-11-29T10:00:06Z|Xabs|5\n2016-11-29T10:00:20Z|Srpm|UNAVAILABLE|Xabs|5\n2016-11-29T10:00:02Z|Srpm|1200|Xabs|99\n2016-11-29T10:00:09Z|Srpm|1200|Xabs|5\n2016-11-29T10:00:20Z|Srpm|UNAVAILABLE|Xabs|5\n";
    for log in [twice.as_str(), back] {
        let shift = bins(log.as_bytes(), &mapping(), &order()).unwrap();
        assert_eq!(shift.bins, wanted, "{log}");
        assert!(!shift.is_whole, "{log}");
        let account = shift.account.to_string();
        assert!(
            account.contains("values of a time told before"),
            "{account}"
        );
    }
}

/// What is missing of a log and its leaps, as a person sees them.
fn missing(log: &str) -> (bool, Vec<String>, usize) {
    let shift = bins(log.as_bytes(), &mapping(), &order()).unwrap();
    let covered = shift.covered.iter();
    let covered = covered.map(|(first, last)| format!("{} {}", words(*first), words(*last)));
    (shift.is_whole, covered.collect(), shift.leaps.len())
}

#[test]
fn a_log_that_has_a_part_of_the_shift_alone_says_which() {
    let whole = "2016-11-29T10:00:00Z 2016-11-29T10:00:22Z".to_owned();
    let stands = LOG.join("\n").replace("Srpm|UNAVAILABLE", "Srpm|0");
    assert_eq!(missing(&stands), (true, vec![whole.clone()], 0));
    // No speed from 20 s on.
    assert_eq!(missing(&LOG.join("\n")), (false, vec![whole], 0));
    // It ends early.
    let part = "2016-11-29T10:00:00Z 2016-11-29T10:00:06Z".to_owned();
    assert_eq!(missing(&LOG[..4].join("\n")), (false, vec![part], 0));
    // The day jumps by one.
    let part = "2016-11-29T10:00:00Z 2016-11-29T10:00:05Z".to_owned();
    let jumped = LOG.join("\n").replace("29T10:00:06", "30T10:00:06");
    let jumped = jumped.replace("29T10:00:2", "30T10:00:2");
    assert_eq!(missing(&jumped), (false, vec![part], 1));
    // One line cannot be read.
    let odd = format!("{}\nhello\n", LOG.join("\n"));
    assert!(!missing(&odd).0);
}

/// By hand: the speed before the stamp of 2035 holds to 5 s, that of its line from 6 s on, so the first bin has
/// (5 · 600 + 4 · 1200)/10 1/min and no later bin the speed of before.
#[test]
fn one_stamp_of_2035_is_told_and_turns_no_spindle() {
    let log = "2016-11-29T09:59:00Z|Srpm|600\n2016-11-29T10:00:05Z|Xabs|5\n2035-01-01T00:00:00Z|Srpm|1200\n2016-11-29T10:00:06Z|Xabs|5\n2016-11-29T10:00:30Z|Xabs|5\n";
    let shift = bins(log.as_bytes(), &mapping(), &order()).unwrap();
    let rpm = shift.bins.iter();
    let rpm = rpm.map(|bin| bin.spindle_rad_s * 30.0 / std::f64::consts::PI);
    let rpm: Vec<_> = rpm.map(|rpm| rpm.round() as i64).collect();
    assert_eq!(rpm, [780, 1200, 1200]);
    assert_eq!((shift.leaps.len(), shift.is_whole), (2, false));
}

#[test]
fn a_log_of_which_nothing_lies_within_the_order_is_refused_with_its_range() {
    let other_day = LOG.join("\n").replace("2016", "2026");
    let other_keys = LOG.join("\n").replace("Xabs", "x").replace("Srpm", "s");
    for (log, words) in [
        ("", "no line with a value has a date; 0 lines taken"),
        ("hello\n", "1 lines without a bar (first in line 1)"),
        ("|Srpm|600\n", "no line with a value has a date"),
        (
            other_day.as_str(),
            "it reaches from 2026-11-29T09:59:00Z to 2026-11-29T10:00:22Z: correct from and to in the order, with an offset",
        ),
        (
            "1480413540000|Srpm|600\n1480413550000|Srpm|700\n",
            "1480413540000 first; as ms since 1970 this is 2016-11-29T09:59:00Z: write the stamps as such dates",
        ),
        (
            "1480413540|Srpm|600\n1480413550|Srpm|700\n",
            "as s since 1970 this is 2016-11-29T09:59:00Z",
        ),
        (
            other_keys.as_str(),
            "without a number of the spindle or an axis",
        ),
    ] {
        let refused = bins(log.as_bytes(), &mapping(), &order()).unwrap_err();
        let refused = refused.to_string();
        assert!(refused.contains(words), "{refused}");
    }
}

/// It was off for two days, and the order lies between.
#[test]
fn an_order_within_a_pause_of_the_log_is_refused_with_the_pause_and_one_time_zone() {
    let log = "2016-11-28T09:00:00Z|Srpm|600\n2016-11-28T10:10:00+01:00|Srpm|600\n2016-11-30T09:00:00Z|Srpm|600\n2016-11-30T09:10:00Z|Srpm|600\n";
    let refused = bins(log.as_bytes(), &mapping(), &order()).unwrap_err();
    let refused = refused.to_string();
    for words in [
        "the order asks for 2016-11-29T10:00:00Z to",
        "(all times in UTC): it reaches from 2016-11-28T09:00:00Z to 2016-11-30T09:10:00Z",
        "and has nothing from 2016-11-28T09:10:00Z to 2016-11-30T09:00:00Z: correct from and to",
        "without one they are UTC",
    ] {
        assert!(refused.contains(words), "{words}: {refused}");
    }
}

/// A line without a date belongs to the one before it; a log of a Mac of old ends its lines with CR.
#[test]
fn lines_without_a_date_and_other_ends_of_lines_change_no_bin() {
    let wanted = bins(LOG.join("\n").as_bytes(), &mapping(), &order());
    let wanted = wanted.unwrap().bins;
    for end in ["\r", "\r\n"] {
        let log = LOG
            .join(end)
            .replace("|Srpm|600|Xabs|5", &format!("|Srpm|600{end}|Xabs|5"));
        let found = bins(log.as_bytes(), &mapping(), &order()).unwrap();
        assert_eq!(found.bins, wanted, "{end:?}");
    }
}

#[test]
fn a_false_speed_counts_by_its_time_and_is_named() {
    let log = |every_s: usize, false_at: Option<usize>| {
        let line = |k: usize| {
            let at_s = k * every_s;
            let rpm = if Some(k) == false_at { 9_999 } else { 3_000 };
            format!(
                "2016-11-29T10:{:02}:{:02}Z|Srpm|{rpm}\n",
                at_s / 60,
                at_s % 60
            )
        };
        (0..1_200 / every_s).map(line).collect::<String>()
    };
    let order = ShiftOrder {
        to: read_stamp("2016-11-29T10:20:00Z").unwrap(),
        ..order()
    };
    for (every_s, wanted_rpm) in [(1, 3_700), (5, 6_500), (10, 9_999), (30, 9_999)] {
        let of = |false_at| bins(log(every_s, false_at).as_bytes(), &mapping(), &order).unwrap();
        assert_eq!(of(None).doubtful, []);
        let found = of(Some(30 / every_s));
        let rpm = found.bins[3].rpm();
        assert!((rpm - wanted_rpm).abs() <= 1, "{every_s}: {rpm}");
        let [named] = found.doubtful.as_slice() else {
            panic!("{every_s}: {:?}", found.doubtful)
        };
        assert!((named.rpm - 9_999.0).abs() < 1e-6 && (named.others_rpm - 3_000.0).abs() < 1e-9);
        assert!(words(named.during.0).contains("10:00:30"));
        assert_eq!(found.is_whole, of(None).is_whole);
    }
}
