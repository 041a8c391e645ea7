//! Two runs of one scenario are the same bytes.

use abbe_tests::scenario::{SHORT_PLAN, Scenario, mcap_file};

#[test]
fn replay_record_twice_gives_equal_bytes() {
    let scenario = Scenario::copy_of("first_run");
    scenario.write("plan.yaml", SHORT_PLAN);
    let bags = [(); 2].map(|()| std::fs::read(mcap_file(&scenario.run().join("bag"))).unwrap());
    let differs = bags[0].iter().zip(&bags[1]).position(|(a, b)| a != b);
    eprintln!("{} and {} bytes", bags[0].len(), bags[1].len());
    assert_eq!(differs, None, "first byte that differs");
    assert_eq!(bags[0].len(), bags[1].len());
    let other = Scenario::copy_of("first_run");
    other.write("plan.yaml", SHORT_PLAN);
    other.replace("plant.yaml", "seed: 20240229", "seed: 20240230");
    let bag = std::fs::read(mcap_file(&other.run().join("bag"))).unwrap();
    assert_ne!(bag, bags[0], "another seed is another run");
}
