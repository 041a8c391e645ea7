//! Tables with numbers that no instrument writes.

use std::time::Duration;

use abbe_tests::program::{Process, command, root};

#[test]
fn a_table_whose_motion_would_never_end_is_refused_with_its_time() {
    let home = tempfile::tempdir().unwrap();
    let csv = home.path().join("far.csv");
    std::fs::write(
        &csv,
        "run;target mm;deviation um\n1;-1e12;0,1\n1;1e12;0,2\n",
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
    let ended = Process::start(import).ended_within(Duration::from_secs(20));
    assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
    for word in ["far.csv", "at most 86400 s"] {
        assert!(ended.said.contains(word), "{word}: {}", ended.said);
    }
}
