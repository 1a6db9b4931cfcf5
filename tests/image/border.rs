//! What lies beyond the edge of an image.

use jacoflow::image::Border;
use proptest::prelude::*;

fn spell(border: Border) -> String {
    (-5..9).map(|i| ['a', 'b', 'c', 'd'][border.index(i, 4)]).collect()
}

#[test]
fn each_border_continues_as_documented() {
    assert_eq!(spell(Border::Reflect), "ddcbaabcddcbaa");
    assert_eq!(spell(Border::Replicate), "aaaaaabcdddddd");
    assert_eq!(spell(Border::Wrap), "dabcdabcdabcda");
}

proptest! {
    #[test]
    fn every_index_falls_inside(index in -100_000isize..100_000, len in 1usize..50) {
        for border in [Border::Reflect, Border::Replicate, Border::Wrap] {
            prop_assert!(border.index(index, len) < len);
        }
    }

    #[test]
    fn reflection_is_symmetric_about_both_edges(k in 0isize..200, len in 1usize..50) {
        let n = len as isize;
        prop_assert_eq!(Border::Reflect.index(-1 - k, len), Border::Reflect.index(k, len));
        prop_assert_eq!(Border::Reflect.index(n + k, len), Border::Reflect.index(n - 1 - k, len));
    }
}
