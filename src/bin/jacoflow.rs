//! The binary: see [`jacoflow::cli`].

fn main() {
    std::process::exit(jacoflow::cli::run(std::env::args_os()));
}
