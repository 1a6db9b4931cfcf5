use super::*;

#[test]
fn fortran_order_is_undone() {
    // Element (i, j, k) = 100 i + 10 j + k of shape (2, 3, 4), first axis fastest.
    let mut stored = Vec::new();
    for k in 0..4 {
        for j in 0..3 {
            for i in 0..2 {
                stored.push(100 * i + 10 * j + k);
            }
        }
    }
    let values = from_fortran_order(&stored, &[2, 3, 4]);
    assert!(values.iter().enumerate().all(|(n, v)| *v == 100 * (n / 12) + 10 * (n / 4 % 3) + n % 4));
    assert_eq!(from_fortran_order(&[7], &[]), [7]);
    assert!(from_fortran_order::<u8>(&[], &[0, 3]).is_empty());
}
