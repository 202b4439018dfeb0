//! Plots, as inline SVG.

use std::io;

use plotters::prelude::*;

/// One point of error against run time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Point {
    pub(super) label: String,
    pub(super) frame_ms: f64,
    pub(super) psnr_y_db: f64,
}

fn failed(e: impl std::fmt::Display) -> io::Error {
    io::Error::other(e.to_string())
}

/// Mean PSNR against mean frame time, the time on a logarithmic axis: up and to the left is better.
pub(super) fn error_against_time(points: &[Point]) -> io::Result<String> {
    let mut svg = String::new();
    if points.is_empty() {
        return Ok(svg);
    }
    {
        let area = SVGBackend::with_string(&mut svg, (900, 460)).into_drawing_area();
        area.fill(&WHITE).map_err(failed)?;
        let times = points.iter().map(|p| p.frame_ms.max(1e-3));
        let (t0, t1) = times.fold((f64::INFINITY, 0f64), |(a, b), t| (a.min(t), b.max(t)));
        let dbs = points.iter().map(|p| p.psnr_y_db);
        let (d0, d1) = dbs.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), d| (a.min(d), b.max(d)));
        let pad = (0.1 * (d1 - d0)).max(1.0);
        let mut chart = ChartBuilder::on(&area)
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(60)
            .build_cartesian_2d((t0 / 1.6..t1 * 2.5).log_scale(), d0 - pad..d1 + pad)
            .map_err(failed)?;
        chart
            .configure_mesh()
            .x_desc("mean frame time, ms (logarithmic)")
            .y_desc("mean PSNR-Y, dB")
            .light_line_style(WHITE)
            .draw()
            .map_err(failed)?;
        for (i, p) in points.iter().enumerate() {
            let colour = Palette99::pick(i).to_rgba();
            let at = (p.frame_ms.max(1e-3), p.psnr_y_db);
            let mark = EmptyElement::at(at)
                + Circle::new((0, 0), 5, colour.filled())
                + Text::new(p.label.clone(), (8, -6), ("sans-serif", 13));
            chart.draw_series(std::iter::once(mark)).map_err(failed)?;
        }
        area.present().map_err(failed)?;
    }
    Ok(svg)
}

/// Values a frame, one line a series.
pub(super) fn by_frame(title: &str, series: &[(String, Vec<(f64, f64)>)]) -> io::Result<String> {
    let mut svg = String::new();
    let all = || series.iter().flat_map(|s| s.1.iter().copied()).filter(|p| p.1.is_finite());
    let (Some(last), Some(top)) =
        (all().map(|p| p.0).max_by(f64::total_cmp), all().map(|p| p.1).max_by(f64::total_cmp))
    else {
        return Ok(svg);
    };
    let low = all().map(|p| p.1).fold(f64::INFINITY, f64::min);
    let span = (top - low).max(1e-9);
    {
        let area = SVGBackend::with_string(&mut svg, (900, 300)).into_drawing_area();
        area.fill(&WHITE).map_err(failed)?;
        let mut chart = ChartBuilder::on(&area)
            .margin(12)
            .x_label_area_size(40)
            .y_label_area_size(70)
            .build_cartesian_2d(0.0..last.max(1.0), low - 0.05 * span..top + 0.05 * span)
            .map_err(failed)?;
        chart.configure_mesh().x_desc("frame").y_desc(title).light_line_style(WHITE).draw().map_err(failed)?;
        for (i, (name, points)) in series.iter().enumerate() {
            let colour = Palette99::pick(i).to_rgba();
            chart
                .draw_series(LineSeries::new(points.iter().copied().filter(|p| p.1.is_finite()), colour))
                .map_err(failed)?
                .label(name.clone())
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour));
        }
        chart.configure_series_labels().background_style(WHITE.mix(0.8)).draw().map_err(failed)?;
        area.present().map_err(failed)?;
    }
    Ok(svg)
}
