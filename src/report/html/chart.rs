//! What all charts of a page have in common. Colours are variables of `style.css`, so that one chart fits light and dark pages.
use kuva::plot::scatter::MarkerShape;
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;
use kuva::render::theme::Theme;
use std::sync::Arc;

/// Number of colours in `style.css`: `--c0`, `--c1` and so on.
pub const COLOURS: usize = 8;

const SHAPES: [MarkerShape; 8] = [
    MarkerShape::Circle,
    MarkerShape::Square,
    MarkerShape::Triangle,
    MarkerShape::Diamond,
    MarkerShape::TriangleDown,
    MarkerShape::Star,
    MarkerShape::Pentagon,
    MarkerShape::Cross,
];

/// The colour of the series with this index.
pub fn colour(index: usize) -> String {
    format!("var(--c{})", index % COLOURS)
}

/// The marker of the series with this index.
pub fn shape(index: usize) -> MarkerShape {
    SHAPES[index % SHAPES.len()]
}

/// Colour of what belongs to no series.
pub const INK: &str = "var(--ink)";
/// Colour of what is less important.
pub const FAINT: &str = "var(--faint)";

/// Layout for these plots, 1000 units wide: the page scales it.
pub fn layout(plots: &[Plot], height: f64) -> Layout {
    let ink = || INK.to_owned();
    let theme = Theme {
        background: "none".to_owned(),
        axis_color: ink(),
        grid_color: "var(--grid)".to_owned(),
        tick_color: ink(),
        text_color: ink(),
        legend_bg: "none".to_owned(),
        legend_border: "none".to_owned(),
        ..Theme::light()
    };
    let layout = Layout::auto_from_plots(plots).with_theme(theme).with_width(1000.0).with_height(height);
    layout.with_font_family("system-ui, sans-serif").with_legend_box(false)
}

/// Whether logarithmic axes have a place for the value. The plotting crate draws nothing below 1e-10, and a tick for each decade.
pub fn is_drawn(value: f64) -> bool {
    (1e-9..1e12).contains(&value)
}

/// Ticks of logarithmic axes as their shortest text.
pub fn plain_ticks(layout: Layout) -> Layout {
    layout.with_tick_format(TickFormat::Custom(Arc::new(tick)))
}

/// The shortest text of a tick, which is 1, 2 or 5 times a power of 10.
fn tick(v: f64) -> String {
    // Computed powers of 10 may be off by a few bits.
    let rounded = format!("{v:.0e}");
    match v {
        1e-4..1e6 => rounded.parse().map(|v: f64| v.to_string()).unwrap_or(rounded),
        _ => rounded,
    }
}

/// Draws SVG to be put into a page: it scales with the page, and names no address of a schema.
pub fn svg(plots: Vec<Plot>, layout: Layout, label: &str) -> String {
    let svg = kuva::render_to_svg(plots, layout);
    let size = |name: &str| {
        let rest = svg.split_once(&format!("{name}=\""))?.1;
        rest.split_once('"')?.0.parse::<f64>().ok()
    };
    let (width, height) = (size("width").unwrap_or(1.0), size("height").unwrap_or(1.0));
    // Inside HTML the namespace is known.
    let plain = svg.replacen(r#" xmlns="http://www.w3.org/2000/svg""#, "", 1);
    let head = format!(r#"<svg viewBox="0 0 {width} {height}" role="img" aria-label="{label}""#);
    plain.replacen("<svg", &head, 1)
}
