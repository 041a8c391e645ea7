//! What must hold for every effect of the catalogue.

use machine::file::MachineFile;
use machine::file::effect_ranges::RANGES;
use metrology::{Axis, AxisSet, PerAxis};
use twin::effects::{self, CATALOGUE, Kind, Moment, Parameter, Role, Target};
use twin::{Motion, Response, Run, Session, Twin};

use crate::effects::scene::{bench, busy, instances, parts, rms, variances};

const LIST: &str = include_str!("../../../src/effects.rs");
/// Validations on the plant of `fake_cnc`, in its tests (`tests/plant/scatter.rs`).
const ON_THE_PLANT: [&str; 2] = [
    "val_the_plants_trigger_scatters_with_the_feed",
    "val_the_plants_shaking_has_half_the_square_of_its_amplitude",
];

#[test]
fn ids_are_the_names_of_the_files_and_unique() {
    let files: Vec<_> = LIST
        .lines()
        .filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'))
        .collect();
    let mut ids: Vec<_> = CATALOGUE.iter().map(|kind| kind.id).collect();
    ids.sort_unstable();
    assert_eq!(ids, files);
    ids.dedup();
    assert_eq!(ids.len(), CATALOGUE.len());
}

#[test]
fn the_readme_lists_every_effect_and_no_other() {
    let readme = include_str!("../../../README.md");
    let rows = |line: &&str| line.starts_with("| `") && line.split('|').count() == 6;
    let section = readme
        .split("## ")
        .find(|part| part.starts_with("Twin and effects"));
    let listed: Vec<_> = section.unwrap().lines().filter(rows).collect();
    assert_eq!(listed.len(), CATALOGUE.len());
    for (row, kind) in listed.iter().zip(CATALOGUE) {
        let cells: Vec<_> = row.split('|').map(str::trim).collect();
        assert_eq!(cells[1], format!("`{}`", kind.id));
        assert_eq!(
            (cells[2], cells[4]),
            (kind.title, kind.needs),
            "{}",
            kind.id
        );
    }
}

/// What the head of a module says under a heading; empty where there is no such heading.
fn told<'t>(source: &'t str, heading: &str) -> &'t str {
    let head = source.split("\n\n").next().unwrap_or("");
    let from = head.split(&format!("//! # {heading}\n")).nth(1);
    let to_next = from.and_then(|text| text.split("//! # ").next());
    to_next.unwrap_or("").trim_matches(['/', '!', ' ', '\n'])
}

/// The module of an effect and its tests, in that order.
#[expect(
    clippy::disallowed_methods,
    reason = "what a file says of its physics is in the file alone"
)]
fn files(kind: &Kind) -> [String; 2] {
    let here = env!("CARGO_MANIFEST_DIR");
    ["src", "tests/it"].map(|folder| {
        let path = format!("{here}/{folder}/effects/{}.rs", kind.id);
        std::fs::read_to_string(path).unwrap()
    })
}

#[test]
fn every_file_tells_its_physics_its_limits_its_sources_and_its_validation() {
    for kind in CATALOGUE {
        let [source, tests] = files(kind);
        for heading in ["Model", "Holds when", "Agreement"] {
            assert!(!told(&source, heading).is_empty(), "{}: {heading}", kind.id);
        }
        let references = told(&source, "References");
        assert!(references.contains("\\[1\\] "), "{}: no source", kind.id);
        assert!(!references.contains("memory"), "{}: not looked up", kind.id);
        let named = told(&source, "Agreement").split('`').skip(1).step_by(2);
        let validations: Vec<_> = named.filter(|name| name.starts_with("val_")).collect();
        let is_here = |name: &&&str| tests.contains(&format!("fn {name}()"));
        assert!(validations.iter().any(|name| is_here(&name)), "{}", kind.id);
        let elsewhere: Vec<_> = validations.iter().filter(|name| !is_here(name)).collect();
        for name in elsewhere {
            assert!(ON_THE_PLANT.contains(name), "{}: {name}", kind.id);
        }
    }
}

#[test]
fn every_effect_has_a_wider_form_or_the_reason_why_none() {
    for kind in CATALOGUE {
        let [source, _] = files(kind);
        let reason = told(&source, "Holds when").split("No wider form: ").nth(1);
        assert_eq!(kind.free.is_empty(), reason.is_some(), "{}", kind.id);
        assert!(reason.is_none_or(|words| words.len() > 30), "{}", kind.id);
    }
}

#[test]
fn the_table_of_known_effects_has_every_file() {
    let readme = include_str!("../../../README.md");
    let section = readme.split("### The effects of the literature").nth(1);
    let table = section.and_then(|text| text.split("\n## ").next()).unwrap();
    let cells: Vec<_> = table
        .lines()
        .filter_map(|row| row.split('|').nth(2))
        .collect();
    for kind in CATALOGUE {
        let name = format!("`{}`", kind.id);
        assert!(cells.iter().any(|cell| cell.contains(&name)), "{name}");
    }
    let named = cells
        .iter()
        .flat_map(|cell| cell.split('`').skip(1).step_by(2));
    for name in named {
        assert!(effects::kind(name).is_some(), "{name}");
    }
}

#[test]
fn the_machine_file_is_checked_with_the_ranges_of_the_catalogue() {
    let of = |kind: &&Kind| {
        let parameters = kind.parameters.iter().chain(kind.free);
        let rows = parameters.map(|p| (p.name, p.low, p.high));
        (kind.id, rows.collect::<Vec<_>>())
    };
    let listed = RANGES.iter().map(|(kind, rows)| (*kind, rows.to_vec()));
    assert_eq!(
        listed.collect::<Vec<_>>(),
        CATALOGUE.iter().map(of).collect::<Vec<_>>()
    );
}

#[test]
fn every_effect_is_described() {
    for kind in CATALOGUE {
        let id = kind.id;
        assert!(!kind.title.is_empty() && !kind.needs.is_empty(), "{id}");
        assert!(kind.amplitudes().count() > 0, "{id}");
        // What widens a scatter may be a shape as well, which is off at 0, and so may the ends of a curve's part of the travel.
        let widens = |p: &Parameter| {
            let is_off = kind.moment == Moment::Variance && p.low.abs() < f64::EPSILON;
            let is_end = ["free_from_mm", "free_to_mm"].contains(&p.name);
            p.name.starts_with("free_") && (p.role == Role::Amplitude || is_off || is_end)
        };
        assert!(kind.free.iter().all(widens), "{id}");
        let mut names = vec![];
        for p in kind.parameters.iter().chain(kind.free) {
            assert!(p.low < p.high && p.typical > 0.0, "{id} {}", p.name);
            assert!((p.low..=p.high).contains(&p.typical), "{id} {}", p.name);
            names.push(p.name);
            if p.role == Role::Amplitude {
                assert!((p.low..=p.high).contains(&0.0), "{id} {}", p.name);
            } else if let Some(grid) = p.role.grid() {
                assert!(grid.is_sorted_by(|a, b| a < b), "{id} {}", p.name);
                assert!(
                    grid.iter().all(|value| (p.low..=p.high).contains(value)),
                    "{id} {}",
                    p.name
                );
            }
        }
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), kind.parameters.len() + kind.free.len(), "{id}");
    }
}

#[test]
fn amplitudes_come_before_shapes() {
    for kind in CATALOGUE {
        let is_shape = |p: &effects::Parameter| p.role != Role::Amplitude;
        assert!(kind.parameters.is_sorted_by_key(is_shape), "{}", kind.id);
    }
}

/// Values with all amplitudes, the free ones too, times a factor.
fn values(kind: &Kind, factor: f64) -> Vec<f64> {
    let all = kind.parameters.iter().chain(kind.free);
    all.map(|p| match p.role {
        Role::Amplitude => p.typical * factor,
        Role::Shape { .. } | Role::Frequency { .. } => p.typical,
    })
    .collect()
}

fn respond(
    machine: &MachineFile,
    session: &Session,
    kind: &Kind,
    target: &Target,
    values: &[f64],
) -> Response {
    let effect = (kind.build)(target.clone(), values);
    let twin = Twin::new(machine).unwrap();
    twin.respond(session, &session.runs[0], &[effect.as_ref()])
}

/// Value at a place; a series that nothing was written to is zero.
fn value(series: &[f64], place: usize) -> f64 {
    series.get(place).copied().unwrap_or(0.0)
}

/// The largest rms of `a - factor b` over the rms of `b`, over all parts.
fn mismatch(a: &[(&str, &[f64])], b: &[(&str, &[f64])], factor: f64) -> f64 {
    let of = |(a, b): (&[f64], &[f64])| {
        let size = rms(b.iter().copied());
        let off = rms((0..a.len().max(b.len())).map(|k| value(a, k) - factor * value(b, k)));
        if size > 0.0 { off / size } else { off }
    };
    a.iter()
        .zip(b)
        .map(|(a, b)| of((a.1, b.1)))
        .fold(0.0, f64::max)
}

/// How far an effect's response may be off the sum of its parts. A clock that is late shows where the machine was, which
/// bends with time.
fn linear_to(id: &str) -> f64 {
    if matches!(id, "clock_drift" | "clock_offset") {
        0.1
    } else {
        1e-9
    }
}

#[test]
fn prop_a_response_is_proportional_to_the_amplitudes() {
    let (machine, session) = busy();
    for (kind, target) in instances(&machine) {
        let once = respond(&machine, &session, kind, &target, &values(kind, 1.0));
        let twice = respond(&machine, &session, kind, &target, &values(kind, 2.0));
        // Until the play is taken up, a slide in a wider play stands still for longer; here there are
        // strokes of 0.1 mm.
        let limit = match kind.id {
            "backlash" => 0.1,
            id => linear_to(id),
        };
        let off = mismatch(&parts(&twice), &parts(&once), 2.0);
        assert!(off < limit, "{} {target}: {off}", kind.id);
        let off = mismatch(&variances(&twice), &variances(&once), 4.0);
        assert!(off < 1e-9, "{} {target}: {off}", kind.id);
    }
}

#[test]
fn prop_amplitudes_add_up() {
    let (machine, session) = busy();
    for (kind, target) in instances(&machine) {
        let full = values(kind, 1.0);
        let all = kind.parameters.iter().chain(kind.free);
        let places: Vec<_> = all
            .enumerate()
            .filter(|(_, p)| p.role == Role::Amplitude)
            .map(|(place, _)| place)
            .collect();
        let together = respond(&machine, &session, kind, &target, &full);
        let alone: Vec<_> = places
            .iter()
            .map(|place| {
                let mut one = full.clone();
                for other in places.iter().filter(|other| *other != place) {
                    one[*other] = 0.0;
                }
                respond(&machine, &session, kind, &target, &one)
            })
            .collect();
        if kind.moment == Moment::Variance {
            continue;
        }
        let wanted = parts(&together);
        let alone: Vec<_> = alone.iter().map(parts).collect();
        for (part, (name, series)) in wanted.iter().enumerate() {
            let size = rms(series.iter().copied());
            let off = rms((0..series.len()).map(|k| {
                let sum: f64 = alone.iter().map(|one| value(one[part].1, k)).sum();
                sum - series[k]
            }));
            let limit = linear_to(kind.id);
            assert!(off <= limit * size, "{} {target} {name}: {off}", kind.id);
        }
    }
}

#[test]
fn prop_zero_amplitudes_give_exactly_nothing() {
    let (machine, session) = busy();
    for (kind, target) in instances(&machine) {
        let nothing = respond(&machine, &session, kind, &target, &values(kind, 0.0));
        for (name, series) in parts(&nothing).into_iter().chain(variances(&nothing)) {
            assert!(
                series.iter().all(|x| *x == 0.0),
                "{} {target} {name}",
                kind.id
            );
        }
    }
}

#[test]
fn prop_each_effect_acts_somewhere_in_its_moment() {
    let (machine, session) = busy();
    for kind in CATALOGUE {
        let mut acts = false;
        for target in kind.targets_on(&machine) {
            let response = respond(&machine, &session, kind, &target, &values(kind, 1.0));
            let is_set = |(_, series): &(&str, &[f64])| series.iter().any(|x| *x != 0.0);
            let (mean, scatter) = (parts(&response), variances(&response));
            let finite = |(_, series): &(&str, &[f64])| series.iter().all(|x| x.is_finite());
            assert!(
                mean.iter().chain(&scatter).all(finite),
                "{} {target}",
                kind.id
            );
            match kind.moment {
                Moment::Mean => {
                    assert!(!scatter.iter().any(is_set), "{} {target}", kind.id);
                    acts |= mean.iter().any(is_set);
                }
                Moment::Variance => {
                    assert!(!mean.iter().any(is_set), "{} {target}", kind.id);
                    acts |= scatter.iter().any(is_set);
                }
            }
        }
        assert!(acts, "{}", kind.id);
    }
}

#[test]
fn prop_each_effect_is_added_to_what_is_there() {
    let (machine, session) = busy();
    let twin = Twin::new(&machine).unwrap();
    for (kind, target) in instances(&machine) {
        let effect = (kind.build)(target.clone(), &values(kind, 1.0));
        let run = &session.runs[0];
        let once = twin.respond(&session, run, &[effect.as_ref()]);
        let twice = twin.respond(&session, run, &[effect.as_ref(), effect.as_ref()]);
        let off = mismatch(&parts(&twice), &parts(&once), 2.0).max(mismatch(
            &variances(&twice),
            &variances(&once),
            2.0,
        ));
        assert!(off < 1e-9, "{} {target}: {off}", kind.id);
    }
}

#[test]
fn prop_targets_and_values_survive_the_machine_file() {
    let machine = bench();
    for (kind, target) in instances(&machine) {
        let values = values(kind, 0.5);
        let mut written = machine.clone();
        written.effects = vec![kind.entry(&target, &values)];
        let text = serde_saphyr::to_string(&written).unwrap();
        let read = MachineFile::parse(&text, "again.yaml").unwrap();
        assert_eq!(read.effects, written.effects, "{text}");
        effects::known(&read).unwrap();
    }
}

#[test]
fn prop_the_effect_read_from_a_file_is_the_one_that_was_written() {
    let (machine, session) = busy();
    let twin = Twin::new(&machine).unwrap();
    for (kind, target) in instances(&machine) {
        let values = values(kind, 0.5);
        let read = effects::from_entry(&machine, 0, &kind.entry(&target, &values)).unwrap();
        let built = respond(&machine, &session, kind, &target, &values);
        let response = twin.respond(&session, &session.runs[0], &[read.as_ref()]);
        assert!(response == built, "{} {target}", kind.id);
    }
}

#[test]
fn prop_refused_values_name_place_value_and_limit() {
    let machine = bench();
    for (kind, target) in instances(&machine) {
        for (place, p) in kind.parameters.iter().chain(kind.free).enumerate() {
            for value in [p.low - 1.0, p.high + 1.0, f64::NAN] {
                let mut values = values(kind, 1.0);
                values[place] = value;
                let refused = effects::from_entry(&machine, 4, &kind.entry(&target, &values));
                let message = refused.err().map(|e| e.to_string()).unwrap_or_default();
                for part in [
                    format!("effects[4] ({})", kind.id),
                    format!("{} = {value}", p.name),
                    format!("{} and {}", p.low, p.high),
                ] {
                    assert!(message.contains(&part), "{message}: {part}");
                }
            }
        }
    }
}

#[test]
fn wrong_names_are_refused_with_what_would_be_right() {
    let machine = bench();
    let kind = effects::kind("backlash").unwrap();
    let good = kind.entry(&kind.targets_on(&machine)[0], &kind.typical());
    let message = |entry| {
        effects::from_entry(&machine, 2, &entry)
            .err()
            .unwrap()
            .to_string()
    };
    let mut wrong = good.clone();
    wrong.kind = String::from("backslash");
    assert!(message(wrong).contains("effects[2].kind = `backslash`"));
    let mut wrong = good.clone();
    wrong.axis = Some(String::from("C"));
    assert!(message(wrong).contains("axis `C`: must be one of `X`, `Y`, `Z`"));
    let mut wrong = good.clone();
    wrong.parameters.insert(String::from("width_mm"), 0.004);
    assert!(message(wrong).contains("unknown key `width_mm`; it has width_um"));
    let mut wrong = good;
    wrong.parameters.clear();
    assert!(message(wrong).contains("`width_um` is missing"));
}

#[test]
fn prop_a_run_that_recorded_less_is_no_reason_to_panic() {
    let (machine, session) = busy();
    let run = &session.runs[0];
    let motion = &run.motion;
    let few = AxisSet::EMPTY.with(Axis::X).with(Axis::Z);
    let mut of_few = PerAxis::<Vec<f64>>::default();
    for axis in few.iter() {
        of_few[axis].clone_from(&motion.position[axis]);
    }
    for motion in [
        Motion::default(),
        Motion::new(motion.time_s.clone(), few, of_few).unwrap(),
    ] {
        let mut less = Session {
            runs: vec![Run {
                motion,
                ..run.clone()
            }],
            ..Session::default()
        };
        for touch in &mut less.runs[0].touches {
            touch.tick = None;
        }
        for (kind, target) in instances(&machine) {
            respond(&machine, &less, kind, &target, &values(kind, 1.0));
        }
    }
}

/// The page on machine files has a row for each effect, with every parameter and its range.
#[test]
fn the_reference_has_the_ranges_of_the_catalogue() {
    let page = include_str!("../../../../../../docs/reference/machine-file.md");
    for kind in twin::effects::CATALOGUE {
        let begin = format!("| `{}` |", kind.id);
        let row = page.lines().find(|line| line.starts_with(&begin));
        let row = row.unwrap_or_else(|| panic!("no row of {}", kind.id));
        for parameter in kind.parameters {
            let range = if parameter.low < 0.0 && parameter.low + parameter.high == 0.0 {
                format!("±{}", parameter.high)
            } else {
                format!("{} to {}", parameter.low, parameter.high)
            };
            let words = format!("`{}` ({range})", parameter.name);
            assert!(row.contains(&words), "{words} is not in: {row}");
        }
    }
}
