# Means over people by timing point, and a mixed model, from a results folder of jointz.
# Put this file beside the folder, or change its name here.
folder <- "results"

# Text columns are named so that participant 01 keeps its zero and a timing point T stays text.
estimates <- read.csv(file.path(folder, "estimates.csv"), na.strings = "", encoding = "UTF-8",
  colClasses = c(participant = "character", timing_point = "character",
    parameter = "character", unit = "character", method = "character",
    status = "character", session = "character", side = "character"))
print(table(estimates$parameter, estimates$status))

# One row a person: the mean over the sessions and sides of the person.
ok <- subset(estimates, status == "ok")
people <- aggregate(value ~ participant + timing_point + parameter, data = ok, FUN = mean)

means <- aggregate(value ~ timing_point + parameter, data = people,
  FUN = function(x) c(mean = mean(x), sd = sd(x), people = length(x)))
means <- do.call(data.frame, means)
names(means) <- c("timing_point", "parameter", "mean", "sd", "people")
write.csv(means, row.names = FALSE, quote = FALSE)

# Does stiffness differ between timing points within people?
stiffness <- subset(people, parameter == "stiffness")
if (requireNamespace("lme4", quietly = TRUE)) {
  fit <- lme4::lmer(value ~ timing_point + (1 | participant), data = stiffness)
  print(summary(fit))
  print(anova(fit))  # no p value: load lmerTest, or use pbkrtest::KRmodcomp
} else {
  message("The mixed model needs lme4: install.packages(\"lme4\")")
}
