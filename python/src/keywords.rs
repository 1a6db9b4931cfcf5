//! Keyword options, declared once each.
//!
//! A list of options is a macro that hands `name: kept as taken = default,` to another macro:
//! [`keep_options`] makes the struct that holds and pickles them, [`constructor`] the `__new__` of a class
//! that takes them. Python thereby sees the full signature, and an option is added in one line.

/// Hands `$then!` its `[$target]`, the options `$own`, and those that estimators and filters share.
macro_rules! with_common {
    ($then:ident [$($target:tt)*] $($own:tt)*) => {
        $then! {
            [$($target)*]
            $($own)*
            grid: Object as Object = None,
            mask: Object as Object = None,
            preprocess: Object as Object = None,
            fps: Object as Object = None,
            pixel_pitch: Object as Object = None,
            length_unit: Option<String> as Option<String> = None,
            precision: Option<String> as Option<String> = None,
            threads: Option<Integer> as Option<Integer> = None,
            simd: Option<String> as Option<String> = None,
        }
    };
}

/// The struct of the options: as a dictionary when pickled.
macro_rules! keep_options {
    ([$name:ident] $($option:ident: $kept:ty as $taken:ty = $default:tt,)*) => {
        /// The keyword options, as a dictionary when pickled.
        #[derive(FromPyObject, IntoPyObjectRef)]
        #[pyo3(from_item_all)]
        pub struct $name {
            $(pub $option: $kept,)*
        }
    };
}

/// `__new__` with the options as keywords; `$class::from_arguments` makes the object.
macro_rules! constructor {
    ([$class:ident from $name:ident] $($option:ident: $kept:ty as $taken:ty = $default:tt,)*) => {
        #[pymethods]
        impl $class {
            #[new]
            #[pyo3(signature = (*, $($option = $default),*))]
            fn new(
                py: Python<'_>,
                $(#[pyo3(from_py_with = $crate::options::named::$option)] $option: $taken),*
            ) -> Outcome<Self> {
                Self::from_arguments(py, $name { $($option: $option.into()),* })
            }
        }
    };
}

/// Read-only attributes of a frozen class: `name(this, slf) -> type = value;` with the object as Rust has it
/// and, where the value needs it, as Python has it.
macro_rules! getters {
    ($class:ty; $($(#[$doc:meta])* $name:ident($this:ident $(, $slf:ident)?) -> $type:ty = $value:expr;)*) => {
        #[pymethods]
        impl $class {
            $(
                $(#[$doc])*
                #[getter]
                #[allow(unused_variables, reason = "not every value needs both")]
                #[allow(clippy::elidable_lifetime_names, reason = "not every type has the lifetime")]
                fn $name<'py>(slf: &Bound<'py, Self>) -> $type {
                    let $this = slf.get();
                    $(let $slf = slf;)?
                    $value
                }
            )*
        }
    };
}

pub(super) use {constructor, getters, keep_options, with_common};
