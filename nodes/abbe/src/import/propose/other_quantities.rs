//! Columns of logs and circles that hold another quantity, another sign or a multiple of the readings are refused by their word.

use super::of;

/// What is read of a column beside its times or angles: the map, or why it is refused.
fn read(head: &str) -> Result<String, String> {
    let home = tempfile::tempdir().expect("a folder");
    let path = home.path().join("a.csv");
    let row = |k: u32| match head.starts_with("run") {
        true => format!("1,{},{}.5\n", 10 * k, k % 3),
        false => format!("{},{}.5,20.{k}\n", 60 * k, k),
    };
    let rows: String = (0..8).map(row).collect();
    std::fs::write(&path, format!("{head}\n{rows}")).expect("a file");
    let proposal = of(&path).map_err(|error| format!("{error:#}"))?;
    Ok(proposal.map)
}

#[test]
fn a_log_of_another_quantity_sign_or_size_is_refused_with_the_word() {
    for (name, word) in [
        ("-z_um", "-"),
        ("\u{2212}Z um", "\u{2212}"),
        ("minus z um", "minus"),
        ("neg. z um", "neg"),
        ("z inverted um", "inverted"),
        ("z_um x10", "x10"),
        ("z/2 um", "/"),
        ("abs z um", "abs"),
        ("dz/dt um", "dt"),
        ("z velocity um", "velocity"),
        ("z setpoint um", "setpoint"),
        ("z residual um", "residual"),
        ("z model um", "model"),
        ("z predicted um", "predicted"),
        ("z sum um", "sum"),
        ("cum. z um", "cum"),
        ("roughness um", "roughness"),
        ("vibration z um", "vibration"),
        ("thickness um", "thickness"),
        ("clearance um", "clearance"),
    ] {
        let said = read(&format!("time_s,{name},spindle degC")).expect_err(name);
        let words = format!("column \"{name}\" ({word}): may hold no plain readings");
        assert!(said.contains(&words), "{said}");
    }
    for name in ["z_um", "Z um", "z-displacement um", "drift z (um)"] {
        let map = read(&format!("time_s,{name},spindle degC")).expect(name);
        assert!(
            map.contains(&format!("displacement_um: \"{name}\"")),
            "{map}"
        );
    }
}

#[test]
fn a_circle_of_another_quantity_sign_or_size_is_refused_with_the_word() {
    for (name, word) in [
        ("-radial um", "-"),
        ("neg radial um", "neg"),
        ("radial/2 um", "/"),
        ("radial um x10", "x10"),
        ("radial residual um", "residual"),
        ("radial velocity um", "velocity"),
        ("radial model um", "model"),
        ("radial command um", "command"),
    ] {
        let said = read(&format!("run,angle_deg,{name}")).expect_err(name);
        let words = format!("column \"{name}\" ({word}): may hold no plain readings");
        assert!(said.contains(&words), "{said}");
    }
    for name in ["radial um", "radial deviation um"] {
        let map = read(&format!("run,angle_deg,{name}")).expect(name);
        assert!(map.contains(&format!("radial_um: \"{name}\"")), "{map}");
    }
}
