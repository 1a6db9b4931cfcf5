//! Tests of the filters against each other, against statistics, and against recorded numbers.
