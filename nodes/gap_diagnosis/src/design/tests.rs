use super::*;
use crate::preflight::rig::{circles, floors, machine};

fn candidates(machine: &MachineFile) -> Vec<Candidate> {
    let of = |(title, radii): (&str, &[f64])| Candidate {
        title: title.to_owned(),
        session: circles(machine, radii, 1),
        minutes: 0.5,
        set_up: "plate".to_owned(),
        most_repeats: WANTED_REPEATS,
        is_at_hand: true,
    };
    let radii: [(&str, &[f64]); 2] = [("circle R50", &[50.0]), ("circle R25", &[25.0])];
    radii.into_iter().map(of).collect()
}

fn order<'o>(
    machine: &'o MachineFile,
    noise: &'o Floors,
    set_up_min: &'o BTreeMap<String, f64>,
    config: &'o GapConfig,
) -> Order<'o> {
    Order {
        machine,
        floors: noise,
        set_up_min,
        minutes: 6.0,
        likely: &[],
        config,
    }
}

#[test]
fn a_design_is_the_same_each_time_and_keeps_its_minutes() {
    let (machine, noise, config) = (machine(), floors(0.3), GapConfig::default());
    let set_up_min = BTreeMap::from([("plate".to_owned(), 3.0)]);
    let order = order(&machine, &noise, &set_up_min, &config);
    let all = candidates(&machine);
    let found = design(&all, &order).unwrap();
    assert_eq!(found, design(&all, &order).unwrap());
    let minutes: Vec<f64> = found.rungs.iter().map(|rung| rung.minutes).collect();
    assert_eq!(minutes, [6.0, 10.0, 20.0, 40.0, 80.0]);
    assert_eq!(found.wanted, 0);
    for rung in &found.rungs {
        assert!(rung.used_min <= rung.minutes + 1e-9, "{rung:?}");
        assert!(!rung.tests.is_empty());
    }
    for pair in found.rungs.windows(2) {
        assert!(pair[1].worst >= pair[0].worst);
    }
    let play = found.effects.iter().find(|one| one.effect == "backlash");
    let from = play.unwrap().named_from[0].unwrap();
    assert!((0.01..2.0).contains(&from), "{from}");
    let lobing = found.hidden.iter().find(|one| one.effect == "probe_lobing");
    assert!(lobing.is_some_and(|one| !one.needs.is_empty()));
}

#[test]
fn what_a_design_cannot_use_is_named() {
    let (machine, noise, config) = (machine(), floors(0.3), GapConfig::default());
    let set_up_min = BTreeMap::from([("plate".to_owned(), 3.0)]);
    let of = |minutes, likely: &[Likely]| {
        let order = Order {
            minutes,
            likely,
            ..order(&machine, &noise, &set_up_min, &config)
        };
        design(&candidates(&machine), &order)
            .unwrap_err()
            .to_string()
    };
    let likely = |effect: &str, axis: Option<&str>, weight| Likely {
        effect: effect.to_owned(),
        axis: axis.map(str::to_owned),
        size: None,
        weight,
    };
    assert!(of(0.5, &[]).contains("minutes = 0.5"));
    assert!(of(481.0, &[]).contains("481"));
    let wrong = of(20.0, &[likely("rust", None, 1.0)]);
    assert!(wrong.contains("\"rust\": is no effect"), "{wrong}");
    let absent = of(20.0, &[likely("backlash", Some("W"), 1.0)]);
    assert!(absent.contains("backlash W"), "{absent}");
    assert!(of(20.0, &[likely("backlash", None, 101.0)]).contains("weight"));
    let elsewhere = BTreeMap::new();
    let order = order(&machine, &noise, &elsewhere, &config);
    let error = design(&candidates(&machine), &order).unwrap_err();
    assert!(error.to_string().contains("\"plate\": is no set-up"));
}

/// An effect that counts for nothing does not hold the worst separability down, and one of twice the size is as well shown
/// as half the size with twice the signature.
#[test]
fn a_larger_stated_size_is_named_from_the_same_size() {
    let (machine, noise, config) = (machine(), floors(0.3), GapConfig::default());
    let set_up_min = BTreeMap::from([("plate".to_owned(), 3.0)]);
    let from = |size: Option<f64>| {
        let likely = [Likely {
            effect: "backlash".to_owned(),
            axis: Some("X".to_owned()),
            size,
            weight: 1.0,
        }];
        let order = Order {
            likely: &likely,
            minutes: 80.0,
            ..order(&machine, &noise, &set_up_min, &config)
        };
        let found = design(&candidates(&machine), &order).unwrap();
        let all = found.effects.into_iter();
        let mut play = all.filter(|one| one.effect == "backlash" && one.axis == "X");
        let play = play.next().unwrap();
        (play.stated, play.named_from[3].unwrap())
    };
    let ((typical, usual), (stated, other)) = (from(None), from(Some(8.0)));
    assert!((stated - 8.0).abs() < 1e-12 && (stated - typical).abs() > 1e-9);
    assert!((usual / other - 1.0).abs() < 1e-9, "{usual} {other}");
}
