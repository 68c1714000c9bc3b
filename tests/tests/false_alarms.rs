//! A thin slice of `false-alarms`: no healthy drive is stopped.

use arso_tests::false_alarms::moves;

#[test]
fn healthy_drives_are_not_stopped() {
    for drive in 0..20 {
        let alarms = moves(drive, 3);
        assert!(alarms.is_empty(), "{}", alarms[0]);
    }
}
