//! What a newcomer runs: `cargo xtask demo` and `cargo xtask test`.

fn main() {}
