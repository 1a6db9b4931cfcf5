//! The derived quantities of one motion.

use jacoflow::flow::derived::Quantity;

#[test]
fn names_round_trip() {
    for q in Quantity::ALL {
        assert_eq!(Quantity::parse(q.name()).unwrap(), q);
    }
    assert!(Quantity::parse("vorticity").unwrap_err().to_string().contains("curl"));
}
