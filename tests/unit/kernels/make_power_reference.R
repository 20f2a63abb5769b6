# Power of t tests by pwr (GPL-3), in power_reference.json; that file is its output.
#   Rscript make_power_reference.R > power_reference.json     (Debian: r-cran-pwr)
suppressMessages(library(pwr))

people <- c(3, 5, 8, 10, 16, 30, 100)
effects <- c(.1, .3, .5, .8, 1.2, 2)
row <- function(type, n, effect, power, alpha)
  sprintf('{"design": "%s", "n": %.10g, "effect": %.10g, "power": %.10g, "alpha": %g}',
    c(paired = "paired", two.sample = "groups")[type], n, effect, power, alpha)
# pwr solves for effects up to 10, which two people do not reach.
tests <- function(type) c(
  sapply(c(.05, .01), function(alpha) sapply(c(2, people), function(n) sapply(effects, function(d)
    row(type, n, d, pwr.t.test(n = n, d = d, sig.level = alpha, type = type)$power, alpha)))))
smallest <- function(type) sapply(c(.5, .8, .95), function(power) sapply(people, function(n)
  row(type, n, pwr.t.test(n = n, power = power, type = type)$d, power, .05)))
rows <- sapply(list(power = tests, smallest = smallest), function(make)
  paste0("[", paste(unlist(lapply(c("paired", "two.sample"), make)), collapse = ",\n"), "]"))
cat("{", paste0('"', names(rows), '": ', rows, collapse = ",\n"), "}\n")
