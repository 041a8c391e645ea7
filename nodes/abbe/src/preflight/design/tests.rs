use std::collections::BTreeSet;

use gap_diagnosis::design::Rung;

use super::*;

fn shipped(scenario: &str) -> (PathBuf, String, MachineFile) {
    let home = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../launch_configs");
    let path = home.join(scenario).join("machine.yaml");
    let text = std::fs::read_to_string(&path).unwrap();
    let machine = MachineFile::parse(&text, "machine.yaml").unwrap();
    (path, text, machine)
}

fn whole_shop(machine: &MachineFile) -> Shop {
    let all = ["probe", "grid", "laser", "ballbar", "thermometers"];
    let all = all.map(|word| means(word).unwrap());
    let there = all
        .into_iter()
        .filter(|means| Shop::new(&[*means], &[], machine).is_ok());
    Shop::new(&there.collect::<Vec<_>>(), &[], machine).unwrap()
}

/// One test of each kind: instrument, first key of its step, what warms.
fn kinds(offers: Vec<Offer>) -> Vec<Offer> {
    let mut seen = BTreeSet::new();
    let mut is_new = |offer: &Offer| {
        let keys = [
            "trajectory: circle",
            "stations",
            "scan",
            "diagonals",
            "rotary",
            "artefact",
        ];
        let key = keys.into_iter().find(|key| offer.steps[0].contains(key));
        let heat = format!("{:?}", offer.heat);
        seen.insert((offer.set_up.means, key, heat, offer.steps.len()))
    };
    let all = offers.into_iter();
    all.filter(|offer| is_new(offer)).collect()
}

/// Programs that the sequencer makes of a test's steps pass through the fake machine's control in its dry run.
#[test]
fn every_kind_of_test_runs_on_the_fake_machines_control_and_reads_something() {
    for scenario in ["gap_first", "five_axis"] {
        let (_, _, machine) = shipped(scenario);
        let shop = whole_shop(&machine);
        let control = programme::control(&machine);
        let (offers, more) = menu::offers(&machine);
        assert_eq!(more, 0);
        let titles: BTreeSet<&str> = offers.iter().map(|offer| offer.title.as_str()).collect();
        assert_eq!(titles.len(), offers.len());
        let mut n = 0;
        for offer in kinds(offers) {
            for text in offer.programs.values() {
                programs::check(&machine, text).unwrap();
            }
            let found = candidate(&offer, &machine, &shop, &control);
            let found = found.unwrap_or_else(|error| panic!("{}: {error:#}", offer.title));
            let mut readings = found.session.runs.iter().flat_map(|run| &run.readings);
            assert!(readings.next().is_some(), "{}", offer.title);
            assert!(found.minutes > SETTLE_MIN, "{}", offer.title);
            n += 1;
        }
        assert!(n >= 8, "{scenario}: {n}");
    }
}

/// A machine with its own plant beside it, and one without.
#[test]
fn a_written_folder_passes_validate_and_none_is_overwritten() {
    let home = tempfile::tempdir().unwrap();
    let (own, text, machine) = shipped("gap_first");
    let alone = home.path().join("machine.yaml");
    std::fs::write(&alone, &text).unwrap();
    let shop = whole_shop(&machine);
    let control = programme::control(&machine);
    let (offers, _) = menu::offers(&machine);
    let rung = Rung {
        minutes: 60.0,
        used_min: 55.0,
        tests: offers
            .iter()
            .map(|offer| (offer.title.clone(), offer.most_repeats))
            .collect(),
        worst: 1.0,
        named: 1,
    };
    let stands = folder::stands(&offers, &rung);
    for (name, path, is_own) in [("of_own", &own, true), ("of_stand_in", &alone, false)] {
        let stand_in = stand_in::of(path, &machine, &control).unwrap();
        assert_eq!(stand_in.is_own, is_own);
        let folder = home.path().join(name);
        let setting = folder::Setting {
            stands: &stands,
            shop: &shop,
            thermometers: &["`bed`".to_owned()],
            used_min: 55.0,
        };
        let contents = Contents {
            machine: &text,
            plan: folder::plan(&stands, 60.0),
            instructions: folder::instructions(&folder, &setting),
            programs: folder::programs(&stands),
            stand_in: &stand_in,
            minutes: 60.0,
        };
        let written = folder::write(&folder, &contents).unwrap();
        assert!(written.contains(&folder.join(INSTRUCTIONS)));
        assert_eq!(validate::mistakes(&folder).unwrap(), Vec::<String>::new());
        let again = format!("{:#}", folder::write(&folder, &contents).unwrap_err());
        assert!(again.contains("nothing is overwritten"), "{again}");
    }
}

/// Repeats stand apart: every test once, then those that are repeated.
#[test]
fn repeats_are_spread_over_a_set_up_and_a_warming_test_comes_last() {
    let (_, _, machine) = shipped("gap_first");
    let (offers, _) = menu::offers(&machine);
    let on_grid: Vec<&Offer> = offers
        .iter()
        .filter(|offer| offer.set_up.means == Means::Grid)
        .collect();
    let warm = on_grid.iter().find(|offer| offer.heat.is_some()).unwrap();
    let rung = Rung {
        minutes: 60.0,
        used_min: 50.0,
        tests: vec![
            (warm.title.clone(), 1),
            (on_grid[0].title.clone(), 3),
            (on_grid[1].title.clone(), 1),
        ],
        worst: 1.0,
        named: 1,
    };
    let stands = folder::stands(&offers, &rung);
    assert_eq!(stands.len(), 1);
    let titles: Vec<&str> = stands[0]
        .tests
        .iter()
        .map(|test| test.title.as_str())
        .collect();
    let [a, b] = [&*on_grid[0].title, &*on_grid[1].title];
    assert_eq!(titles, [a, b, &*warm.title, a, a]);
}

#[test]
fn minutes_out_of_range_are_refused_before_anything_is_written() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("new");
    let (machine, ..) = shipped("gap_first");
    for minutes in [0.0, -5.0, 481.0, f64::NAN] {
        let wanted = Wanted {
            machine: &machine,
            minutes,
            with: &[Means::Grid],
            mounting: &[],
            likely: None,
            floors: &|machine: &MachineFile| super::super::floors::floors(machine, &[]),
            floored: &[],
            out: &out,
            html: None,
            json: false,
            full: false,
        };
        let error = wanted.execute().unwrap_err().to_string();
        assert!(error.contains("from 1 to 480 min"), "{error}");
        assert!(!out.exists());
    }
}
