# What metafor (GPL-3) makes of the sets in metafor_reference.json; that file is its output.
#   Rscript make_metafor_reference.R > metafor_reference.json     (Debian: r-cran-metafor)
# Values that nobody published are drawn here, with a seed, and stand in the file.
suppressMessages(library(metafor))

number <- function(x) paste0("[", paste(ifelse(is.na(x), "null", sprintf("%.16g", x)), collapse = ", "), "]")
object <- function(parts) paste0("{", paste0('"', names(parts), '": ', unlist(parts), collapse = ", "), "}")

one <- function(y, v) {
  sharp <- list(threshold = 1e-12 * var(y), maxiter = 100000)
  fit <- rma(y, v, method = "REML", test = "knha", control = sharp)
  adhoc <- rma(y, v, method = "REML", test = "adhoc", control = sharp)
  tau2 <- suppressMessages(confint(fit, control = list(tol = 1e-13 * var(y), maxiter = 10000,
    tau2.max = 1e5 * var(y))))$random[1, 2:3]
  told <- predict(fit)
  if (any(is.na(tau2))) tau2 <- c(0, 0)
  object(list(values = number(y), variances = number(v),
    mean = number(fit$beta), se = number(fit$se), interval = number(c(fit$ci.lb, fit$ci.ub)),
    prediction = number(c(told$pi.lb, told$pi.ub)), tau2 = number(fit$tau2),
    tau2_se = number(fit$se.tau2), tau2_interval = number(tau2), i2_pct = number(fit$I2),
    q = number(fit$QE), q_p = number(fit$QEp), log_likelihood = number(as.numeric(logLik(fit))),
    weights = number(weights(fit) / 100), modified = number(c(adhoc$ci.lb, adhoc$ci.ub))))
}

set.seed(20261)
many_v <- runif(40, 0.2, 4)
unequal_v <- 10^seq(-4, 1, length.out = 10)
calm_v <- runif(8, 1, 3)
edge_v <- runif(9, 0.8, 1.2)
# Colditz et al. 1994 (BCG): log relative risks and their variances, 13 trials.
bcg_y <- c(-0.8893, -1.5854, -1.3481, -1.4416, -0.2175, -0.7861, -1.6209, 0.0120, -0.4694, -1.3713, -0.3394, 0.4459, -0.0173)
bcg_v <- c(0.3256, 0.1946, 0.4154, 0.0200, 0.0512, 0.0069, 0.2230, 0.0040, 0.0564, 0.0730, 0.0124, 0.5325, 0.0714)
univariate <- list(
  bcg = list(bcg_y, bcg_v),
  two_apart = list(c(52, 71), c(4, 9)),
  two_alike = list(c(60, 61), c(4, 9)),
  three = list(c(62.1, 55.4, 70.8), c(12, 5, 20)),
  five = list(c(10, 12, 17, 11, 9), c(1, 2, 0.5, 3, 1)),
  many = list(60 + rnorm(40, 0, sqrt(many_v + 6)), many_v),
  no_spread = list(60 + 0.2 * rnorm(8), calm_v),
  near_zero = list(60 + as.vector(scale(rnorm(9))) * 1.03, edge_v),
  unequal = list(1.5 + rnorm(10, 0, sqrt(unequal_v + 0.05)), unequal_v),
  tiny = list(c(2.1e-3, 2.9e-3, 2.4e-3, 3.6e-3), c(2e-8, 5e-8, 1e-8, 4e-8)),
  large = list(c(18200, 25100, 21900, 19900, 31000), c(4e6, 1e6, 2e6, 9e6, 1e6)),
  equal = list(c(3, 5, 4, 8, 1, 6), rep(0.7, 6)),
  outlier = list(c(40, 41, 39, 42, 40, 95), c(2, 2, 3, 1, 2, 2)))

entries <- function(sets, job) {
  texts <- sapply(names(sets), function(name) {
    paste0('    "', name, '": ', do.call(job, unname(sets[[name]])))
  })
  paste(texts, collapse = ",\n")
}
cat(paste0('{\n  "made_with": "metafor ', packageVersion("metafor"), ", ", R.version.string, '",\n'))
cat(paste0('  "univariate": {\n', entries(univariate, one), "\n  }\n}\n"))
