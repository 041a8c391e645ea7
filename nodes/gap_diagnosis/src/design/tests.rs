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
    let mut shown = found.effects.iter().filter_map(|one| one.named_from[0]);
    assert!(shown.next().is_some_and(|from| from > 0.0), "{found:?}");
    // Every effect is named, hidden or unsure, and no effect is two of these.
    let sum = found.rungs[0].named + found.hidden.len() + found.unsure.len();
    assert_eq!(sum, found.effects.len());
    let is_hidden = |name: &String| found.hidden.iter().any(|one| one.effect == *name);
    assert!(!found.unsure.iter().any(is_hidden), "{:?}", found.unsure);
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

/// The stated size changes what is aimed at; where everything is measured anyway, what is named from which size stays.
#[test]
fn a_larger_stated_size_is_named_from_the_same_size() {
    let (machine, noise, config) = (machine(), floors(0.3), GapConfig::default());
    let set_up_min = BTreeMap::from([("plate".to_owned(), 3.0)]);
    let of = |likely: &[Likely]| {
        let order = Order {
            likely,
            minutes: 80.0,
            ..order(&machine, &noise, &set_up_min, &config)
        };
        design(&candidates(&machine), &order).unwrap()
    };
    let usual = of(&[]);
    let is_named = |one: &&Aimed| {
        let greatest = effects::kind(&one.effect).map_or(0.0, greatest);
        one.named_from[3].is_some() && 2.0 * one.stated <= greatest
    };
    let before = usual.effects.iter().find(is_named).unwrap();
    let likely = Likely {
        effect: before.effect.clone(),
        axis: Some(before.axis.clone()),
        size: Some(2.0 * before.stated),
        weight: 1.0,
    };
    let larger = of(&[likely]);
    let is_same = |one: &&Aimed| one.effect == before.effect && one.axis == before.axis;
    let after = larger.effects.iter().find(is_same).unwrap();
    assert!((after.stated / before.stated - 2.0).abs() < 1e-12);
    let ratio = after.named_from[3].unwrap() / before.named_from[3].unwrap();
    assert!((ratio - 1.0).abs() < 1e-9, "{ratio}");
}
