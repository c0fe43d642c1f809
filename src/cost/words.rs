//! Numbers as a reader wants them.
use super::document::Estimate;

/// Two or three significant digits, without an exponent where that is short.
pub fn number(value: f64) -> String {
    let digits = |n: i32| (n - 1 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    match value.abs() {
        0.0 => "0".to_owned(),
        v if !(1e-5..1e6).contains(&v) => format!("{value:.1e}"),
        v if v < 1.0 => format!("{value:.*}", digits(2)),
        _ => format!("{value:.*}", digits(3)),
    }
}

/// A time in the unit that suits it.
pub fn milliseconds(ms: f64) -> String {
    match ms {
        ms if ms < 1.0 => format!("{} µs", number(ms * 1e3)),
        ms if ms < 1000.0 => format!("{} ms", number(ms)),
        ms => format!("{} s", number(ms * 1e-3)),
    }
}

/// A factor or an error with its interval.
pub fn factor(estimate: &Estimate) -> String {
    let interval = estimate.interval(number).map(|interval| format!(" ({interval})"));
    format!("{}{}", number(estimate.value), interval.unwrap_or_default())
}

/// A share as a percentage.
pub fn percent(share: f64) -> String {
    format!("{} %", number(100.0 * share))
}

/// Names joined by commas and an "and".
pub fn list(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_two_or_three_digits() {
        let shown = [0.0, 0.01234, 0.5, 1.0, 12.345, 123.4, 98765.0, 1e-7, 2.5e8].map(number);
        assert_eq!(shown, ["0", "0.012", "0.50", "1.00", "12.3", "123", "98765", "1.0e-7", "2.5e8"]);
        assert_eq!([0.25, 40.0, 1500.0].map(milliseconds), ["250 µs", "40.0 ms", "1.50 s"]);
        assert_eq!(list(&["a", "b", "c"]), "a, b and c");
        let estimate = Estimate { value: 2.0, low: Some(1.9), high: Some(2.1) };
        assert_eq!(factor(&estimate), "2.00 (1.90 to 2.10)");
        let of_two_runs = Estimate { value: 0.8, low: Some(2.1e-10), high: Some(3e9) };
        assert_eq!(factor(&of_two_runs), "0.80 (too few runs to tell)");
    }
}
