//! Tables with numbers that no instrument writes.

use std::time::Duration;

use abbe_tests::program::{Process, command, root};

#[test]
fn a_table_with_a_target_beyond_the_travel_is_refused_with_its_place_and_the_limit_and_leaves_nothing()
 {
    let home = tempfile::tempdir().unwrap();
    let csv = home.path().join("far.csv");
    std::fs::write(
        &csv,
        "run;direction;target mm;deviation um\n1;up;-1e12;0,1\n1;up;1e12;0,2\n",
    )
    .unwrap();
    let mut import = command(0, &["import"]);
    import
        .arg(&csv)
        .arg("--map")
        .arg(root().join("tests/import/positioning.yaml"))
        .arg("--machine")
        .arg(root().join("launch_configs/gap_first/machine.yaml"))
        .arg("-o")
        .arg(home.path().join("bag"));
    let ended = Process::start(import).ended_within(Duration::from_secs(60));
    assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
    for word in [
        "far.csv",
        "line 2, column \"target mm\": -1e12",
        "the axis' travel",
    ] {
        assert!(ended.said.contains(word), "{word}: {}", ended.said);
    }
    assert!(!home.path().join("bag").exists());
}
