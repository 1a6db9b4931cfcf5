//! Why a pixel has, or lacks, an estimate.

use jacoflow::types::Status;

#[test]
fn codes_round_trip() {
    for (code, status) in Status::ALL.into_iter().enumerate() {
        assert_eq!(status as usize, code);
        assert_eq!(Status::from_code(code as u8), Some(status));
    }
    assert_eq!(Status::from_code(200), None);
}
