//! Messages of errors.

use jacoflow::Error;

#[test]
fn long_values_are_cut() {
    let long = Error::argument("name", "less", "x".repeat(300)).to_string();
    assert_eq!(long.len(), "name: expected less, got ".len() + 163);
}

#[test]
fn message_names_argument_expectation_and_value() {
    let error = Error::argument("stride", "a positive integer", 0);
    assert_eq!(error.to_string(), "stride: expected a positive integer, got 0");
}
